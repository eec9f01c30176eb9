//! Where results that can be found again are kept between commands.

use std::path::PathBuf;

use anyhow::bail;

use crate::scenario::starts_cache::StartsCache;

/// Names the folder, or switches the cache off.
const VARIABLE: &str = "SEAROOM_CACHE";

/// The folder that `SEAROOM_CACHE` names, else `searoom` in the user's cache folder; none where the variable says
/// `off`, or where there is no such folder.
pub(super) fn folder() -> anyhow::Result<Option<PathBuf>> {
    let given = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    if let Some(value) = given(VARIABLE) {
        if value == "off" {
            return Ok(None);
        }
        let folder = PathBuf::from(value);
        if folder.is_file() {
            bail!("{VARIABLE} names the file {}: name a folder, or `off`", folder.display());
        }
        return Ok(Some(folder));
    }
    let user = given("XDG_CACHE_HOME")
        .or_else(|| given("LOCALAPPDATA"))
        .map(PathBuf::from)
        .or_else(|| given("HOME").map(|home| PathBuf::from(home).join(".cache")));
    Ok(user.map(|folder| folder.join("searoom")))
}

/// The cache of encounter starts.
pub(super) fn encounter_starts() -> anyhow::Result<StartsCache> {
    Ok(folder()?.map_or_else(StartsCache::off, StartsCache::in_folder))
}

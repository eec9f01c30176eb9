//! A run goes on from its checkpoint with the bits it would have had; damage is told, not guessed
//! around.

use std::fs;
use std::path::{Path, PathBuf};

use searoom::nn::Compute;
use searoom::rl::agent::Algorithm;
use searoom::rl::checkpoint::{self, CheckpointError, CheckpointWriter};
use searoom::rl::trainer::{Trainer, TrainerConfig};

use super::tasks::{config, tracking};

fn trainer(config: TrainerConfig) -> Trainer {
    Trainer::new(config, tracking(), Compute::new(1))
}

fn run_to(trainer: &mut Trainer, step: u64) {
    while trainer.step() < step {
        trainer.advance();
    }
}

fn weights(trainer: &mut Trainer) -> [Vec<f32>; 3] {
    trainer.agent().networks().map(|network| network.online.values().to_vec())
}

/// A run with a checkpoint at step 617, in the middle of an episode.
fn saved(algorithm: Algorithm) -> (tempfile::TempDir, Trainer, CheckpointWriter) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut trainer = trainer(config(algorithm));
    run_to(&mut trainer, 617);
    let mut writer = CheckpointWriter::new(folder.path());
    writer.save(&mut trainer).expect("saved");
    (folder, trainer, writer)
}

fn chunk_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join(checkpoint::REPLAY_FOLDER)).expect("replay folder");
    entries.map(|entry| entry.expect("entry").path()).collect()
}

fn load_error(folder: &Path, config: TrainerConfig) -> CheckpointError {
    checkpoint::load(folder, &mut trainer(config)).expect_err("an error")
}

#[test]
fn a_run_resumed_from_disk_goes_on_with_the_same_bits() {
    for algorithm in [Algorithm::LstmTd3, Algorithm::LstmSac] {
        let (folder, mut straight, mut writer) = saved(algorithm);
        run_to(&mut straight, 650);
        // A second checkpoint replaces the first, its chunks included.
        writer.save(&mut straight).expect("saved");
        assert_eq!(chunk_files(folder.path()).len(), 1);

        let mut resumed = trainer(config(algorithm));
        let mut writer = checkpoint::load(folder.path(), &mut resumed).expect("loaded");
        run_to(&mut straight, 700);
        run_to(&mut resumed, 700);
        assert_eq!(weights(&mut straight), weights(&mut resumed));
        assert_eq!(straight.state(), resumed.state());
        assert_eq!(straight.replay().chunks(), resumed.replay().chunks());
        writer.save(&mut resumed).expect("saved again");
        assert_eq!(checkpoint::config(folder.path()).expect("config"), config(algorithm));
    }
}

/// Before the first update, at the end of an episode and beside it, and later on.
#[test]
fn a_run_can_be_stopped_at_any_step() {
    for stop in [1, 29, 30, 31, 90, 333] {
        let folder = tempfile::tempdir().expect("temporary folder");
        let mut straight = trainer(config(Algorithm::LstmTd3));
        run_to(&mut straight, stop);
        CheckpointWriter::new(folder.path()).save(&mut straight).expect("saved");
        let mut resumed = trainer(config(Algorithm::LstmTd3));
        checkpoint::load(folder.path(), &mut resumed).expect("loaded");
        run_to(&mut straight, stop + 45);
        run_to(&mut resumed, stop + 45);
        assert_eq!(weights(&mut straight), weights(&mut resumed), "stopped at {stop}");
        assert_eq!(straight.state(), resumed.state(), "stopped at {stop}");
    }
}

#[test]
fn a_checkpoint_of_another_configuration_is_refused_by_key() {
    let (folder, ..) = saved(Algorithm::LstmSac);
    let mut other = config(Algorithm::LstmSac);
    other.agent.sac.discount = 0.9;
    let error = load_error(folder.path(), other);
    assert!(error.to_string().contains("`agent.sac.discount` was 0.99 and is 0.9"), "{error}");
}

#[test]
fn truncated_files_are_refused_by_name() {
    let (folder, ..) = saved(Algorithm::LstmTd3);
    let chunk = chunk_files(folder.path()).remove(0);
    let whole = fs::read(&chunk).expect("chunk");
    fs::write(&chunk, &whole[..whole.len() / 2]).expect("cut");
    let error = load_error(folder.path(), config(Algorithm::LstmTd3));
    assert!(matches!(&error, CheckpointError::Replay { path, .. } if *path == chunk), "{error}");

    fs::remove_file(&chunk).expect("removed");
    let error = load_error(folder.path(), config(Algorithm::LstmTd3));
    assert!(matches!(&error, CheckpointError::Io { path, .. } if *path == chunk), "{error}");

    let file = folder.path().join(checkpoint::FILE);
    let whole = fs::read(&file).expect("checkpoint");
    fs::write(&file, &whole[..whole.len() - 100]).expect("cut");
    let error = load_error(folder.path(), config(Algorithm::LstmTd3));
    assert!(error.to_string().contains("checkpoint.safetensors"), "{error}");
}

/// What a process that died while writing leaves behind: chunks that no checkpoint names, and
/// temporary files. The old checkpoint loads, and the next one clears them away.
#[test]
fn what_a_killed_process_leaves_behind_does_no_harm() {
    let (folder, ..) = saved(Algorithm::LstmSac);
    let replay = folder.path().join(checkpoint::REPLAY_FOLDER);
    fs::write(replay.join("chunk-00000-step-0000000640.safetensors"), b"half").expect("left over");
    fs::write(replay.join(".abc.partial"), b"half").expect("left over");
    let mut resumed = trainer(config(Algorithm::LstmSac));
    let mut writer = checkpoint::load(folder.path(), &mut resumed).expect("loaded");
    assert_eq!(resumed.step(), 617);
    run_to(&mut resumed, 640);
    writer.save(&mut resumed).expect("saved");
    assert_eq!(chunk_files(folder.path()).len(), 1);
    assert!(checkpoint::load(folder.path(), &mut trainer(config(Algorithm::LstmSac))).is_ok());
}

/// Of a replay of three chunks, a checkpoint writes those that have changed since the last one.
#[test]
fn a_checkpoint_does_not_rewrite_the_whole_replay() {
    let folder = tempfile::tempdir().expect("temporary folder");
    // Random decisions all along: this is about files.
    let config = TrainerConfig { random_steps: u64::MAX, ..config(Algorithm::LstmSac) };
    let mut trainer = trainer(TrainerConfig { replay_capacity: 100_000, ..config });
    let mut writer = CheckpointWriter::new(folder.path());
    run_to(&mut trainer, 40_000);
    writer.save(&mut trainer).expect("saved");
    let written = |folder: &Path| -> Vec<(PathBuf, std::time::SystemTime)> {
        let mut files: Vec<_> = chunk_files(folder)
            .into_iter()
            .map(|file| (file.clone(), fs::metadata(file).and_then(|data| data.modified()).expect("time")))
            .collect();
        files.sort();
        files
    };
    let first = written(folder.path());
    assert_eq!(first.len(), 3);
    run_to(&mut trainer, 40_100);
    writer.save(&mut trainer).expect("saved");
    let second = written(folder.path());
    assert_eq!(first[..2], second[..2], "whole chunks stay as they are");
    assert_ne!(first[2], second[2], "the last one has grown");
}

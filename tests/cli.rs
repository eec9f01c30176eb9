use std::process::{Command, Output};

/// Runs the program in the folder of the package.
pub fn searoom(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_searoom"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("the program starts")
}

#[test]
fn help_and_version_succeed() {
    for argument in ["--help", "--version"] {
        let output = searoom(&[argument]);
        assert_eq!(output.status.code(), Some(0));
        assert!(String::from_utf8_lossy(&output.stdout).contains("searoom"));
    }
}

#[test]
fn a_wrong_command_line_exits_with_2() {
    for arguments in [&["no-such-command"][..], &[], &["--no-such-option"]] {
        let output = searoom(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(!output.stderr.is_empty());
    }
}

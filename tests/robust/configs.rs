//! Checks for any text as a configuration, for the property tests and the fuzz target.

use fillrate::machine::Config;

/// The answer is a configuration, which written out reads back the same, or an error with a message. After a line that begins
/// with `--set`, the rest of the line is a setting on the baseline.
pub fn read_everything(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Some(assignment) = text.strip_prefix("--set ") {
        let mut config = Config::built_in("baseline").expect("the baseline");
        if let Err(error) = config.set(assignment) {
            assert!(!error.to_string().is_empty());
        } else if let Err(error) = config.check() {
            assert!(!error.to_string().is_empty());
        }
        return;
    }
    match Config::parse("fuzzed.ron", text) {
        Ok(config) => {
            let written = config.resolved();
            let again = Config::parse("resolved.ron", &written).unwrap_or_else(|error| panic!("{error} in\n{written}"));
            assert_eq!(written, again.resolved());
            let _ = config.warnings();
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

//! Checks for any text as an experiment, for the property tests and the fuzz target.

use fillrate::machine::Config;
use fillrate::sweep::experiment::Experiment;
use fillrate::sweep::plan::Plan;

/// Maximum number of machines of an experiment, and the number that are checked.
const MOST: u64 = 1000;
const LOOKED_AT: u32 = 20;

/// The answer is an experiment, which written out reads back the same, or an error with a message. Its plan has machines or is refused
/// with a message. A base that is a file of the fuzzer's is taken as the baseline.
pub fn plan_everything(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let experiment = match Experiment::parse("fuzzed.ron", text) {
        Ok(experiment) => experiment,
        Err(error) => return assert!(error.to_string().contains("fuzzed.ron"), "{error}"),
    };
    let written = ron::to_string(&experiment).expect("an experiment is text");
    let again = Experiment::parse("again.ron", &written).unwrap_or_else(|error| panic!("{error} in\n{written}"));
    assert_eq!(again, experiment);

    let baseline = || Config::built_in("baseline").expect("the baseline");
    let mut base = Config::built_in(&experiment.base).unwrap_or_else(|_| baseline());
    if experiment.set.iter().any(|setting| base.set(setting).is_err()) {
        return;
    }
    match Plan::new(base, &experiment, MOST) {
        Ok(plan) => {
            assert!(u64::from(plan.len()) <= MOST);
            for number in 0..plan.len().min(LOOKED_AT) {
                let machine = plan.machine(number).unwrap_or_else(|error| panic!("machine {number}: {error}"));
                assert_eq!(machine.settings.len(), plan.parameters().len());
                if let Err(reason) = machine.config {
                    assert!(!reason.is_empty());
                }
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

//! The example of a unit of one's own: it counts what it says, with any clock.

#[allow(dead_code, reason = "the example is a program")]
#[path = "../../examples/your_unit.rs"]
mod example;

use fillrate::sim::Clock;

#[test]
fn the_example_of_a_unit_counts_its_requests_and_its_stalls() {
    let text = example::report(Clock::SkipIdle).expect("the circuit runs to its end");
    // 16 lines of 16 words: of 256 requests 240 are for the line before, and at 4 requests per cycle the unit is busy for 64 cycles. It starves
    // for the latency of the first channel, and is blocked while four reads wait for the memory. The six add up to the cycles.
    let expected = "133 cycles, 256 requests\nbusy 64\nstarved 10\nblocked 31\nmemory 0\nlatency 0\nidle 28\njoined 240\n";
    assert_eq!(text, expected);
    for clock in [Clock::EveryCycle, Clock::Shuffled(3)] {
        assert_eq!(example::report(clock).expect("the circuit runs to its end"), text);
    }
}

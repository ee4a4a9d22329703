//! Rates of memory traffic, as shares of the highest rate that the memory of a machine has.

use crate::machine::Config;
use crate::machine::config::MemoryKind;

/// The highest rate of a machine's memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MemoryPeak {
    /// Bytes per cycle of the card: of all channels together, in bursts without gaps.
    pub bytes_per_cycle: f64,
    /// Cycles of the card per second.
    clock_hz: f64,
}

/// A rate of memory traffic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MemoryRate {
    /// In 10^9 bytes per second.
    pub gigabytes: f64,
    /// As a share of the peak.
    pub share: f64,
}

impl MemoryPeak {
    /// The peak of a configuration.
    pub fn new(config: &Config) -> MemoryPeak {
        let dram = &config.dram;
        let bytes_per_cycle = if config.memory.kind == MemoryKind::Ideal {
            f64::from(config.memory.ideal_bytes_per_cycle)
        } else {
            let tick = f64::from(dram.card_cycles) / f64::from(dram.clock);
            f64::from(dram.channels) * f64::from(dram.burst_bytes) / (f64::from(dram.burst_cycles) * tick)
        };
        MemoryPeak { bytes_per_cycle, clock_hz: 1e6 * f64::from(config.card.clock_mhz) }
    }

    /// The rate of bytes that move in these cycles; 0 where there are no cycles.
    pub fn rate(&self, bytes: f64, cycles: f64) -> MemoryRate {
        let per_cycle = if cycles > 0.0 { bytes / cycles } else { 0.0 };
        MemoryRate { gigabytes: per_cycle * self.clock_hz / 1e9, share: per_cycle / self.bytes_per_cycle }
    }

    /// The peak itself in 10^9 bytes per second.
    pub fn gigabytes(&self) -> f64 {
        self.bytes_per_cycle * self.clock_hz / 1e9
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_is_channels_by_bytes_by_clock() {
        let mut config = Config::built_in("baseline").expect("it is built in");
        let peak = MemoryPeak::new(&config);
        for (set, factor) in [("memory.dram.channels=4", 0.5), ("memory.dram.channels=8", 1.0)] {
            config.set(set).expect("a knob");
            assert_eq!(MemoryPeak::new(&config).bytes_per_cycle, factor * peak.bytes_per_cycle, "{set}");
        }
        let rate = peak.rate(50.0 * peak.bytes_per_cycle, 100.0);
        assert_eq!((rate.share, rate.gigabytes), (0.5, 0.5 * peak.gigabytes()));
        assert_eq!(peak.rate(7.0, 0.0).share, 0.0);
    }
}

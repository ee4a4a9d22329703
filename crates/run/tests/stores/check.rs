//! What must hold of any sequence of passes: every machine that keeps API order shows what functional rendering shows, frame by frame. So do
//! machines that begin at a later frame.

use machine::{Config, Machine};
use render::{FrameSet, Options};
use sim::Clock;
use trace::Trace;
use work::{Event, RenderKey};

use super::sequence::Sequence;

/// The machines that draw sequences.
pub struct Machines {
    ordered: Vec<Config>,
    unordered: Config,
}

/// The pictures of frames.
type Pictures = Vec<(u32, Vec<u8>)>;

impl Machines {
    /// One machine of each kind, and one that leaves tiles out which memory already has.
    pub fn new() -> Machines {
        let built_in = |name: &str| Config::built_in(name).unwrap_or_else(|error| panic!("{error}"));
        let ordered = ["tiny", "four-pipelines", "sort-first", "sort-middle-binned", "sort-last-fragment", "attila"];
        let mut ordered: Vec<Config> = ordered.map(built_in).into();
        let mut same_tiles = built_in("sort-middle-binned");
        same_tiles.set("bin.skip_same_tiles=true").unwrap_or_else(|error| panic!("{error}"));
        ordered.push(same_tiles);
        Machines { ordered, unordered: built_in("sort-last-image") }
    }

    /// Draws a sequence on machines; how often it was drawn. `part` is one of `of` parts of the machines.
    ///
    /// # Errors
    /// What the first one shows that differs from functional rendering, or why it stopped.
    pub fn check(&self, sequence: &Sequence, part: usize, of: usize) -> Result<u32, String> {
        let Sequence { trace, unordered, frames } = sequence;
        let functional = pictures(&rendered(trace, Options::default())?);
        if functional.len() != *frames as usize {
            return Err(format!("{} frames of {frames} were rendered", functional.len()));
        }
        let mut replays = 1;
        let chosen = self.ordered.iter().enumerate().filter(|(at, _)| at % of == part).map(|(_, config)| config);
        let configs = chosen.chain(unordered.then_some(&self.unordered));
        let mut works: Vec<(RenderKey, Vec<Event>)> = Vec::new();
        for config in configs {
            let key = config.render_key();
            if !works.iter().any(|(known, _)| *known == key) {
                let events = rendered(trace, Options { key, record: true, ..Options::default() })?;
                same("recorded work", &functional, &pictures(&events))?;
                works.push((key, events));
            }
            let Some((_, events)) = works.iter().find(|(known, _)| *known == key) else { continue };
            same(&config.name, &functional, &simulated(config, events)?)?;
            replays += 1;
        }
        if part == 0 {
            self.check_later_frames(trace, &functional)?;
            replays += 2;
        }
        Ok(replays)
    }

    /// Draws a trace on a machine of each sort class that keeps API order, and compares the frames with pictures.
    ///
    /// # Errors
    /// What the first one shows that differs, or why it stopped.
    #[allow(dead_code, reason = "the fuzz target knows no pictures")]
    pub fn show(&self, trace: &Trace, pictures_by_hand: &[Vec<u8>]) -> Result<(), String> {
        let expected: Pictures = (0..).zip(pictures_by_hand.iter().cloned()).collect();
        same("functional rendering", &expected, &pictures(&rendered(trace, Options::default())?))?;
        for config in self.ordered.iter().filter(|config| config.name != "four-pipelines") {
            let events = rendered(trace, Options { key: config.render_key(), record: true, ..Options::default() })?;
            same(&config.name, &expected, &simulated(config, &events)?)?;
        }
        Ok(())
    }

    /// A machine that begins at a frame in the middle, of a rendering of the later frames and of one that hands on all.
    fn check_later_frames(&self, trace: &Trace, functional: &Pictures) -> Result<(), String> {
        let (config, end) = (&self.ordered[0], functional.len() as u32);
        let begin = end / 2;
        let key = config.render_key();
        let later = rendered(trace, Options { key, record: true, frames: (begin..end).into(), ..Options::default() })?;
        same("later frames alone", &functional[begin as usize..], &simulated(config, &later)?)?;
        let one: FrameSet = (begin..begin + 1).into();
        let options = Options { key, record: true, recorded: Some(one.clone()), begins: Some(one), ..Options::default() };
        let all = rendered(trace, options)?;
        let ends = |event: &Event| matches!(event, Event::EndFrame(_));
        let frame = all.split_inclusive(ends).nth(begin as usize).unwrap_or_default();
        same("one recorded frame", &functional[begin as usize..][..1], &simulated(config, frame)?)
    }
}

fn rendered(trace: &Trace, options: Options) -> Result<Vec<Event>, String> {
    let mut events = Vec::new();
    let mut keep = |event| {
        events.push(event);
        Ok(())
    };
    render::render(trace, &options, &mut keep).map_err(|error| format!("rendering: {error}"))?;
    Ok(events)
}

fn pictures(events: &[Event]) -> Pictures {
    let ends = events.iter().filter_map(|event| if let Event::EndFrame(end) = event { Some(end) } else { None });
    ends.map(|end| (end.number, end.reference.to_vec())).collect()
}

fn simulated(config: &Config, events: &[Event]) -> Result<Pictures, String> {
    let mut machine = Machine::new(config).map_err(|error| format!("{}: {error}", config.name))?;
    let report = machine.run(events.iter().cloned(), Clock::SkipIdle);
    let report = report.map_err(|error| format!("{}: {error}", config.name))?;
    let bytes = |frame: machine::FrameReport| (frame.number, frame.picture.map(|picture| picture.bytes).unwrap_or_default());
    Ok(report.frames.into_iter().map(bytes).collect())
}

fn same(what: &str, expected: &[(u32, Vec<u8>)], got: &[(u32, Vec<u8>)]) -> Result<(), String> {
    if expected.len() != got.len() {
        return Err(format!("{what}: {} frames for {}", got.len(), expected.len()));
    }
    for ((number, expected), (_, got)) in expected.iter().zip(got) {
        let differing: Vec<usize> = (0..expected.len().min(got.len())).filter(|&at| expected[at] != got[at]).collect();
        if expected.len() != got.len() || !differing.is_empty() {
            let (all, found) = (expected.len(), differing.len());
            let few: Vec<String> =
                differing.iter().take(8).map(|&at| format!("{at}: {} for {}", got[at], expected[at])).collect();
            return Err(format!("{what}: {found} bytes of {all} of frame {number} differ ({})", few.join(", ")));
        }
    }
    Ok(())
}

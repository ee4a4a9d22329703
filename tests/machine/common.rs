//! Laws for the statistics of every run, on every machine and scene; and small work to run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fillrate::machine::config::SortClass;
use fillrate::machine::{Config, FrameReport, Machine, MachineReport, PhaseReport, Tally};
use fillrate::render;
use fillrate::sim::Clock;
use fillrate::stats::{Group, Leaf, Node, Tree};
use fillrate::trace::Trace;
use fillrate::unit::network::Topology;
use fillrate::unit::scanout::Swap;
use fillrate::work::*;

/// A built-in configuration with changes. The name of a sort class is the machine of four pipelines with it.
pub fn config(name: &str, changes: &[&str]) -> Config {
    let class = SortClass::NAMES.contains(&name);
    let mut config = Config::built_in(if class { "four-pipelines" } else { name }).expect("a built-in configuration");
    if class {
        config.set(&format!("sort={name}")).unwrap_or_else(|error| panic!("{error}"));
    }
    for change in changes {
        config.set(change).unwrap_or_else(|error| panic!("{error}"));
    }
    config.check().unwrap_or_else(|error| panic!("{error}"));
    config
}

/// Whether a case, known by its place on each axis, is among those that the usual suite takes: one in `n`, and all where `FILLRATE_SLOW` is set.
/// Each value of each axis meets some of every other's.
pub fn is_chosen(n: usize, places: &[usize]) -> bool {
    std::env::var_os("FILLRATE_SLOW").is_some() || places.iter().sum::<usize>().is_multiple_of(n)
}

/// What is in a folder, in order.
pub fn entries(folder: &Path) -> Vec<PathBuf> {
    let read = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut entries: Vec<PathBuf> = read.map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    entries
}

/// The work of a scene kept in `traces/`.
pub fn rendered(name: &str) -> Vec<Event> {
    let trace = Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces").join(name)).expect("a scene");
    let mut events = Vec::new();
    let options = render::Options { record: true, ..render::Options::default() };
    let mut keep = |event| {
        events.push(event);
        Ok(())
    };
    render::render(&trace, &options, &mut keep).unwrap_or_else(|error| panic!("{name}: {error}"));
    events
}

/// Runs work from cycle 0 to its end.
pub fn run(config: &Config, events: &[Event], clock: Clock) -> MachineReport {
    let mut machine = Machine::new(config).unwrap_or_else(|error| panic!("{error}"));
    // Draws are reported under one clock only. This must not change any statistic.
    if clock == Clock::SkipIdle {
        machine.watch_draws();
    }
    machine.run(events.iter().cloned(), clock).unwrap_or_else(|error| panic!("{}, {clock:?}: {error}", config.name))
}

/// All statistics of a run, frame by frame, and its pictures.
pub fn everything(report: &MachineReport) -> String {
    let mut text = report.total.json().to_string();
    for frame in &report.frames {
        text.push_str(&frame.tree.json().to_string());
        text.push_str(&frame.number.to_string());
        if let Some(picture) = &frame.picture {
            text.push_str(&format!("{:?} {}", picture.surface, picture.wrong_pixels));
        }
    }
    text
}

/// A dispatch of a number of workgroups of 64 invocations, which load, meet at a barrier, and store.
pub fn dispatch(groups: u32) -> Vec<Event> {
    dispatch_of(groups, 64, 512, true)
}

/// [`dispatch`] of workgroups with these numbers of invocations and bytes of workgroup memory, with or without a barrier.
pub fn dispatch_of(groups: u32, invocations: u32, shared_bytes: u32, barrier: bool) -> Vec<Event> {
    let shape = ShaderShape { registers: 16, inputs: 0, outputs: 0 };
    // Packets load, store and add in lines of three areas of 4096.
    let mut reach = Reach::default();
    reach.writes.add(Extent::new((1 << 21) * LINE, 3 * 4096 * LINE));
    let dispatch = Dispatch {
        number: 0,
        label: String::new(),
        shape,
        groups: groups.into(),
        invocations,
        shared_bytes,
        reach,
        programs: Programs::default(),
    };
    let step = |instructions, then| Step::dependent(instructions, then);
    let mut steps = vec![
        step([2, 4, 0, 1, 0], RequestKind::Load),
        step([3, 1, 1, 1, 0], RequestKind::Barrier),
        step([5, 1, 0, 0, 0], RequestKind::Store),
        step([0, 1, 0, 0, 0], RequestKind::Atomic),
        step([0, 0, 0, 1, 0], RequestKind::End),
    ];
    if !barrier {
        steps.remove(1);
    }
    let mut work = Groups { groups, invocations: CostTable::from(vec![Cost::from(steps)]).into(), ..Groups::default() };
    for packet in 0..groups * invocations.div_ceil(4) {
        work.packets.push(Packet { cost: 0, first_request: work.invocations.requests.len() as u32, first_shared: 0 });
        for place in 0..3 {
            work.invocations.requests.push(Request {
                first_line: work.invocations.lines.len() as u32,
                lines: 1,
                operations: 4,
                ..Request::default()
            });
            work.invocations.lines.push((1 << 21) + place * 4096 + packet / 4);
        }
    }
    vec![Event::Dispatch(Arc::new(dispatch)), Event::Groups(Arc::new(work))]
}

/// A run's statistics, by path.
pub struct Figures<'a>(pub &'a Tree);

impl Figures<'_> {
    /// The figure at a path.
    pub fn at(&self, path: &str) -> u64 {
        let value = self.0.number(path).unwrap_or_else(|| panic!("there is no {path}"));
        assert!(value >= 0.0 && value.fract() == 0.0, "{path} is {value}");
        value as u64
    }

    /// The subtrees of a list such as `units.setup`; none if there is no such list.
    pub fn list(&self, path: &str) -> &[Tree] {
        match self.0.get(path) {
            Some(Node::List(list)) => list,
            _ => &[],
        }
    }

    /// The sum of one leaf over a list.
    pub fn sum(&self, path: &str, leaf: &str) -> u64 {
        self.list(path).iter().map(|tree| Figures(tree).at(leaf)).sum()
    }

    fn funnel(&self, name: &str) -> u64 {
        self.at(&format!("funnel.{name}"))
    }
}

/// Every unit's account adds up to the cycles of the run, and every frame's to the frame's.
pub fn accounts_add_up(tree: &Tree) {
    let cycles = Figures(tree).at("cycles");
    let Some(Node::Tree(units)) = tree.get("units") else { panic!("units") };
    let mut checked = 0;
    for (name, node) in units.entries() {
        let Node::List(list) = node else { panic!("{name}") };
        for (index, unit) in list.iter().enumerate() {
            let of = |reason: &str| Figures(unit).at(reason);
            let sum = of("busy") + of("starved") + of("blocked") + of("memory") + of("latency") + of("idle");
            assert_eq!(sum, cycles, "the account of {name}[{index}]");
            checked += 1;
        }
    }
    assert!(checked > 15, "{checked} units");
}

/// Counters of the frames add up to those of the run. A free-running display shows the last frame after the frame's end. Transfers that are
/// then on their way to memory arrive after it: they count for the run only, and nothing is drawn in that time.
pub fn frames_add_up(report: &MachineReport) {
    let mut sums = std::collections::BTreeMap::<String, u64>::new();
    for frame in &report.frames {
        accounts_add_up(&frame.tree);
        phases_add_up(frame);
        frame.tree.leaves(&mut |path, leaf| {
            if let Leaf::Count(value) = leaf {
                *sums.entry(path.to_owned()).or_default() += value;
            }
        });
    }
    let runs_free = report.total.number("display.presented").is_some();
    let mut checked = 0;
    report.total.leaves(&mut |path, leaf| {
        if let Leaf::Count(value) = leaf {
            let behind = runs_free && !path.starts_with("funnel.");
            let sum = sums.get(path);
            assert!(sum == Some(value) || behind && sum < Some(value), "{path}: {sum:?} of the frames, {value} of the run");
            checked += 1;
        }
    });
    assert!(checked > 200, "{checked} counters");
}

/// A tally's counters by path, the funnel's among them.
fn counters(tally: &Tally) -> std::collections::BTreeMap<String, u64> {
    let funnel = tally.funnel.named().map(|(name, value)| (format!("funnel.{name}"), value));
    let mut counters: std::collections::BTreeMap<_, _> = funnel.collect();
    tally.each(|(steps, of), name, value| {
        let path: Vec<&str> = steps.iter().copied().chain(of).chain([name]).collect();
        assert_eq!(counters.insert(path.join("."), value), None, "{path:?} is there twice");
    });
    counters
}

/// Counters of phases add up to those of the frame, and those of draws to their pass's.
fn phases_add_up(frame: &FrameReport) {
    assert_eq!(frame.phases.iter().map(|phase| phase.cycles).sum::<u64>(), frame.cycles, "phases of frame {}", frame.number);
    let mut sums = std::collections::BTreeMap::<String, u64>::new();
    let add = |sums: &mut std::collections::BTreeMap<String, u64>, tally: &Tally| {
        counters(tally).into_iter().for_each(|(path, value)| *sums.entry(path).or_default() += value);
    };
    let units = |name: &str| Figures(&frame.tree).list(&format!("units.{name}")).len() as u64;
    for PhaseReport { phase, cycles, counts, draws } in &frame.phases {
        let counts = counts.as_ref().expect("it was simulated");
        add(&mut sums, counts);
        let spent = |tally: &Tally, cycles: u64| {
            for (name, spent) in &tally.units {
                assert_eq!(spent.values().sum::<u64>(), cycles * units(name), "{name} in {phase}");
            }
        };
        spent(counts, *cycles);
        let mut of_draws = std::collections::BTreeMap::new();
        draws.iter().for_each(|draw| {
            // Draws that retire together share cycles, and the end of the pass has what their units counted.
            match draw.halves {
                None => spent(&draw.counts, draw.cycles),
                Some(halves) => assert_eq!(halves.iter().sum::<u64>(), draw.cycles, "a draw of {phase}"),
            }
            add(&mut of_draws, &draw.counts);
        });
        if !draws.is_empty() {
            assert_eq!(draws.iter().map(|draw| draw.cycles).sum::<u64>(), *cycles, "draws of {phase}");
            assert_eq!(of_draws, counters(counts), "draws of {phase}");
        }
    }
    let frame = frame.tree.banks_summed();
    let mut checked = 0;
    for (path, value) in sums {
        let of = |name: &str| Figures(&frame).at(&path.replace(".starved", name));
        // A unit that is starved until the end of a frame is idle; within a phase this is not known.
        let whole = if path.ends_with(".starved") { of(".starved") + of(".idle") } else { of(".starved") };
        assert_eq!(value, whole, "{path} of the phases");
        checked += 1;
    }
    assert!(checked > 100, "{checked} counters");
}

/// All that enters a unit leaves it, or is counted as discarded there. `fragments`: whether every draw has a fragment stage.
pub fn conserved(config: &Config, tree: &Tree, fragments: bool) {
    let f = Figures(tree);
    let (units, channels) = (
        |name: &str| f.sum(&format!("units.{name}"), "items"),
        |name: &str, leaf: &str| f.sum(&format!("channels.{name}"), leaf),
    );
    let items = |name: &str| channels(name, "items");

    // Each triangle that passes geometry is set up once, binned or not.
    if matches!(config.card.sort, SortClass::Middle | SortClass::MiddleBinned) {
        assert_eq!(units("distribute"), f.funnel("triangles_setup"));
    }
    if config.card.sort != SortClass::Middle {
        return conserved_anywhere(config, tree, fragments);
    }

    // Vertices: shaded batches return, and are released after assembly.
    assert_eq!(units("fetch"), f.funnel("vertices_in"));
    assert_eq!(items("vertex_warps"), items("vertices_shaded"));
    assert_eq!(items("vertex_warps"), items("vertices_retired"));
    assert!(f.funnel("vertices_shaded") <= f.funnel("vertices_in"));

    // Primitives: each is culled for one reason, or becomes triangles for setup.
    assert_eq!(units("assembly"), f.funnel("primitives_in"));
    assert_eq!(units("clip"), f.funnel("primitives_in"));
    assert_eq!(f.at("sort.sorted_items"), f.funnel("triangles_setup"));
    assert!(f.at("sort.sent") <= f.at("sort.sorted_items"));

    // The sort: every item that is sent arrives, and the bytes are those of triangles and marks.
    if config.network.topology == Topology::PointToPoint {
        assert_eq!(items("sorted"), f.at("sort.redistributed_items") + f.at("sort.marks"));
        assert_eq!(channels("sorted", "bytes"), f.at("sort.redistributed_bytes") + 4 * f.at("sort.marks"));
    }
    // Over a bus one transfer brings all copies.
    if config.network.topology != Topology::Bus {
        assert_eq!(f.at("sort.redistributed_bytes"), 144 * f.at("sort.redistributed_items"));
    }
    assert_eq!(units("setup"), f.at("sort.redistributed_items"));
    if f.at("sort.sent") > 0 {
        let overlap = tree.number("sort.overlap").expect("an overlap");
        assert!((1.0..=f64::from(config.card.pipelines)).contains(&overlap), "{overlap}");
        assert_eq!(overlap, f.at("sort.redistributed_items") as f64 / f.at("sort.sent") as f64);
    }

    conserved_anywhere(config, tree, fragments);
}

/// Laws of conservation for machines of every sort class.
fn conserved_anywhere(config: &Config, tree: &Tree, fragments: bool) {
    let f = Figures(tree);
    let units = |name: &str| f.sum(&format!("units.{name}"), "items");
    let items = |name: &str| f.sum(&format!("channels.{name}"), "items");
    assert_eq!(items("vertex_warps"), items("vertices_shaded"));
    assert_eq!(items("vertex_warps"), items("vertices_retired"));
    // Primitives: each is culled for one reason, or set up; some are both, some have several parts, some are set up by several pipelines.
    let culled: u64 = ["degenerate", "backface", "frustum", "scissor", "no_sample"]
        .map(|why| f.funnel(&format!("culled_{why}")))
        .iter()
        .sum();
    let more: u64 = ["culled", "parts", "copies"].map(|what| f.funnel(&format!("setup_{what}"))).iter().sum();
    assert_eq!(f.funnel("triangles_setup"), f.funnel("primitives_in") - culled + more);
    assert!(f.funnel("setup_parts") == 0 || f.funnel("clipped") > 0);
    assert!(f.funnel("quads_hiz_culled") <= f.funnel("quads_early_culled"));
    assert!(f.at("sort.sent") <= f.at("sort.redistributed_items"));
    assert!(f.at("sort.foreign_items") <= f.at("sort.redistributed_items"));
    assert!(f.at("sort.foreign_bytes") <= f.at("sort.redistributed_bytes"));
    if config.network.topology == Topology::PointToPoint && config.card.sort != SortClass::MiddleBinned {
        let bytes = f.sum("channels.sorted", "bytes");
        // Pixels that a pipeline composes in place are not sent.
        let kind = if config.card.sort == SortClass::LastImage { "foreign" } else { "redistributed" };
        assert_eq!(bytes, f.at(&format!("sort.{kind}_bytes")) + 4 * f.at("sort.marks"));
    }

    // Quads: culled early, or shaded (or finished, if there is no fragment stage).
    assert_eq!(units("traverse"), f.funnel("quads_rasterized"));
    assert!(f.funnel("tiles_hiz_culled") <= f.funnel("tiles_visited"));
    // Hidden quads among the opaque quads that are held back end here.
    let hidden =
        if config.bin.hide && config.card.sort == SortClass::MiddleBinned { f.sum("hiding.hide", "hidden_quads") } else { 0 };
    let kept = f.funnel("quads_rasterized") - f.funnel("quads_early_culled") - hidden;
    assert_eq!(units("interpolate"), f.funnel("quads_shaded"));
    assert_eq!(units("dispatch"), f.funnel("quads_shaded"));
    let lost = f.funnel("fragments_discarded") + f.funnel("fragments_late_failed");
    if fragments {
        assert_eq!(kept, f.funnel("quads_shaded"));
        assert_eq!(f.funnel("fragments_shaded"), f.funnel("fragments_written") + lost);
    } else {
        assert!(kept >= f.funnel("quads_shaded"));
        assert!(f.funnel("fragments_shaded") <= f.funnel("fragments_written") + lost);
    }
    assert_eq!(f.funnel("fragments_shaded") + f.funnel("helper_fragments"), 4 * f.funnel("quads_shaded"));
    assert!(f.funnel("fragments_covered") >= f.funnel("fragments_shaded"));

    // Warps: as many return as are sent; requests are answered.
    assert_eq!(items("fragment_warps"), items("fragments_shaded"));
    assert_eq!(items("compute_warps"), items("computed"));
    assert_eq!(units("compute"), items("computed"));
    assert_eq!(items("texture_requests"), items("texture_answers"));
    assert_eq!(items("vertex_texture_requests"), items("vertex_texture_answers"));
    for (core, counts) in f.list("units.core").iter().zip(f.list("shading.core")) {
        let classes = ["float", "integer", "special", "control", "multiply"];
        let sum: u64 = classes.iter().map(|class| Figures(counts).at(class)).sum();
        assert_eq!(Figures(core).at("items"), sum);
    }

    // Control: tasks are answered.
    for (task, answer) in [("workgroups", "workgroups_done"), ("resolves", "resolved")] {
        assert_eq!(items(task), items(answer), "{task}");
    }
    if config.scanout.runs_free() {
        // The display gets each frame. The last one ends it, or an item of its own does. Swaps in the vertical blank are reported. All
        // frames are shown or dropped.
        let presented = f.at("display.presented");
        assert_eq!(units("scanout"), presented);
        assert!((presented..=presented + 1).contains(&items("shown")), "{} for {presented}", items("shown"));
        assert_eq!(items("scanned"), if config.scanout.swap == Swap::Vsync { presented } else { 0 });
        assert_eq!(f.at("display.shown") + f.at("display.dropped"), presented);
    } else {
        assert_eq!(items("shown"), items("scanned"), "shown");
    }
    assert_eq!(items("pass_ends") % u64::from(config.card.pipelines), 0);

    caches_are_conserved(config, tree);
    acceptance_holds(tree);
    memory_is_conserved(tree, config);
}

fn caches_are_conserved(config: &Config, tree: &Tree) {
    let f = Figures(tree);
    for name in ["vertex", "texture", "depth", "color", "l2"] {
        for cache in f.list(&format!("caches.{name}")) {
            let of = |leaf: &str| Figures(cache).at(leaf);
            assert_eq!(of("accesses"), of("hits") + of("misses"), "{name}");
            assert!(of("evictions") <= of("misses"), "{name}");
        }
    }
    for (cache, rop) in [("depth", "depth"), ("color", "color")] {
        for (cache, rop) in f.list(&format!("caches.{cache}")).iter().zip(f.list(&format!("rop.{rop}"))) {
            let of = |leaf: &str| Figures(rop).at(leaf);
            // A block that is not read may be overwritten piece by piece, be read later, or be evicted before either.
            let brought_in = of("fills") + of("cleared_fills") + of("overwritten");
            let unread = config.color.skip_reads || config.traverse.hierarchical_accept;
            let misses = Figures(cache).at("misses");
            assert!(if unread { brought_in <= misses } else { brought_in == misses }, "{brought_in} of {misses} blocks");
        }
    }
}

/// Everything that hierarchical Z accepts passes the depth test.
fn acceptance_holds(tree: &Tree) {
    let f = Figures(tree);
    assert_eq!(f.sum("rop.depth", "accepted_failed"), 0);
    assert!(f.sum("rop.depth", "overwritten") <= f.sum("hierarchical.traverse", "accepted"));
}

/// The bytes that clients request equal those that the memory serves.
fn memory_is_conserved(tree: &Tree, config: &Config) {
    let f = Figures(tree);
    let Some(Node::Tree(clients)) = tree.get("memory.clients") else { panic!("clients") };
    let all = |leaf: &str| clients.entries().map(|(name, _)| f.at(&format!("memory.clients.{name}.{leaf}"))).sum::<u64>();
    assert_eq!(f.sum("channels.memory_requests", "items"), all("requests"));
    let sector = u64::from(config.texture.sector_bytes);
    let vertex_line = u64::from(config.fetch.line_bytes);
    assert_eq!(f.at("memory.clients.vertex.read_bytes"), vertex_line * f.sum("caches.vertex", "misses"));
    // Texture units request the sectors that miss; all other requests are atomics and stores.
    let sectors = sector * f.sum("shading.fills", "sectors");
    let atomics = f.at("memory.clients.texture.read_bytes") - sectors;
    assert_eq!(atomics % 4, 0);
    assert!(f.at("memory.clients.texture.write_bytes") >= atomics);
    for (client, own) in [("depth", "depth"), ("color", "color")] {
        let (reads, writes) = ("read_bytes", "write_bytes");
        let blocks = |leaf: &str| f.sum(&format!("rop.{own}"), leaf);
        assert_eq!(blocks("fills") == 0, f.at(&format!("memory.clients.{client}.{reads}")) == 0, "{client}");
        assert_eq!(blocks("write_backs") == 0, f.at(&format!("memory.clients.{client}.{writes}")) == 0, "{client}");
    }
    if f.list("memory.l2").is_empty() {
        // An ideal memory serves all requests.
        assert_eq!(f.at("memory.dram.read_bytes"), all("read_bytes"));
        assert_eq!(f.at("memory.dram.write_bytes"), all("write_bytes"));
        return;
    }
    assert_eq!(f.sum("memory.l2", "read_bytes"), all("read_bytes"));
    assert_eq!(f.sum("memory.l2", "write_bytes"), all("write_bytes"));
    assert_eq!(f.sum("units.l2", "items"), all("requests"));
    assert_eq!(f.at("units.crossbar[0].items"), all("requests"));
    assert_eq!(f.at("units.return_path[0].items"), f.sum("channels.memory_answers", "items"));
    // DRAM moves whole bursts.
    assert!(f.at("memory.dram.read_bytes") >= f.sum("memory.l2", "fetched_bytes"));
    assert!(f.at("memory.dram.write_bytes") >= f.sum("memory.l2", "written_back_bytes"));
    let moved = f.sum("memory.l2", "fetched_bytes") + f.sum("memory.l2", "written_back_bytes");
    assert_eq!(f.sum("channels.dram_requests", "bytes"), moved);
}

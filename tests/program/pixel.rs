//! `fillrate pixel`: the history of a pixel.

use std::path::Path;

use fillrate::num::Random;
use fillrate::run::pixel::{PixelQuery, history};
use fillrate::{Config, Fidelity, Options, import, replay};
use serde_json::Value;

use crate::cli::{refused, run};

fn told(arguments: &[&str]) -> String {
    let (code, text, message) = run(&[&["pixel"], arguments].concat());
    assert_eq!(code, 0, "{message}");
    text
}

#[test]
fn the_last_writer_leaves_the_pixel_of_the_picture() {
    for (seed, name) in
        (0..).zip(["cube", "shadow", "spokes-msaa", "particles", "sprites", "layers", "panel.zip", "viewer.zip"])
    {
        let trace = import::open(Path::new("traces").join(name)).unwrap_or_else(|error| panic!("{error}"));
        let config = Config::built_in("tiny").unwrap_or_else(|error| panic!("{error}"));
        let options = Options { frames: 0..1, ..Options::new(config, Fidelity::Functional) };
        let frames = replay(&trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{name}: {error:#}")).frames;
        let (surface, bytes) = frames[0].shown.as_ref().expect("a picture");
        let size = surface.format.block_bytes() as usize;
        let mut random = Random::nth(60, seed);
        let mut drawn = 0;
        for _ in 0..4 {
            // The middle, where most is drawn.
            let at = [surface.width, surface.height].map(|size| size / 4 + random.below(size / 2));
            let query = PixelQuery { frame: 0, at, target: None };
            let told = history(&trace, &query).unwrap_or_else(|error| panic!("{name}, {at:?}: {error:#}"));
            let first = (at[1] * surface.width + at[0]) as usize * size;
            let own: Vec<u8> = told.last[0].iter().flat_map(|word| word.to_le_bytes()).take(size).collect();
            assert_eq!(own, bytes[first..first + size], "{name}, {at:?}");
            drawn += told.events.len();
        }
        assert!(drawn > 0, "{name}");
    }
}

#[test]
fn text_and_json_tell_the_same_history() {
    let text = told(&["traces/cube", "128,128"]);
    assert!(text.starts_with("pixel 128,128 of texture "), "{text}");
    assert!(text.contains("no machine is simulated"), "{text}");
    let json: Value = serde_json::from_str(&told(&["traces/cube", "128,128", "--json"])).expect("JSON");
    let events = json["events"].as_array().expect("events");
    let draws: Vec<&Value> = events.iter().filter(|event| event["kind"] == "fragment").collect();
    assert!(!draws.is_empty() && json["shown"] == true && json["fidelity"] == "functional", "{json}");
    let last = json["last_draw"].as_u64().expect("a draw");
    assert!(text.contains(&format!("The last draw that passed all tests here is draw {last}")), "{text}");
    for event in events {
        assert!(text.contains(event["what"].as_str().expect("words")), "{event}: {text}");
    }
    // A native trace that says nothing of a recording numbers its commands.
    assert!(draws.iter().all(|draw| draw["site"].as_str().is_some_and(|site| site.starts_with("command "))), "{draws:?}");
}

#[test]
fn a_pixel_that_is_not_there_is_refused() {
    for (arguments, reason) in [
        (&["traces/cube", "9999,0"][..], "it has none at 9999,0"),
        (&["traces/cube", "0,0@77"], "does not draw to texture 77: it draws to texture "),
        (&["traces/cube", "0,0", "--frame", "7"], "the trace has no frame 7; it has 1, numbered from 0"),
        (&["traces/cube", "0"], "write it as X,Y or X,Y@TEXTURE"),
    ] {
        let message = refused(&[&["pixel"], arguments].concat());
        assert!(message.contains(reason), "{message}");
    }
}

//! The command, option or value that is meant by one that there is not.

use std::ffi::OsString;

use clap::Command;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};

use crate::num::nearest;

/// The command that the arguments name, with its subcommands.
fn named(top: &Command, given: impl Iterator<Item = OsString>) -> &Command {
    given.fold(top, |command, word| command.get_subcommands().find(|sub| word == sub.get_name()).unwrap_or(command))
}

/// Replaces what a message about the arguments suggests by the nearest name, of knobs' rule: one that begins so comes first.
pub fn correct(wrong: &mut Error, top: &Command) {
    let text = |kind| match wrong.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    let command = named(top, std::env::args_os().skip(1));
    let (kind, found) = match wrong.kind() {
        ErrorKind::InvalidSubcommand => {
            let given = text(ContextKind::InvalidSubcommand);
            let found = nearest(command.get_subcommands().map(Command::get_name), &given).map(str::to_owned);
            (ContextKind::SuggestedSubcommand, found.map(|name| ContextValue::Strings(vec![name])))
        }
        ErrorKind::UnknownArgument => {
            let given = text(ContextKind::InvalidArg);
            let Some(given) = given.strip_prefix("--") else { return };
            let found = nearest(command.get_arguments().filter_map(|argument| argument.get_long()), given);
            (ContextKind::SuggestedArg, found.map(|name| ContextValue::String(format!("--{name}"))))
        }
        ErrorKind::InvalidValue => {
            let Some(ContextValue::Strings(values)) = wrong.get(ContextKind::ValidValue) else { return };
            let found = nearest(values.iter().map(String::as_str), &text(ContextKind::InvalidValue)).map(str::to_owned);
            (ContextKind::SuggestedValue, found.map(ContextValue::String))
        }
        _ => return,
    };
    if let Some(value) = found {
        wrong.insert(kind, value);
        wrong.remove(ContextKind::Suggested);
    }
}

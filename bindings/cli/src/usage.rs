//! How the arguments are read, beyond what clap does: negative numbers, and suggestions for wrong options.

use super::Cli;
use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, CommandFactory, FromArgMatches};
use smaclite_units::file::{did_you_mean, printable_text};
use std::ffi::OsString;
use std::path::PathBuf;
use std::str::FromStr;
use tracing_subscriber::filter::{LevelFilter, Targets};

/// Reads the arguments, the first of which is the program.
pub(super) fn parse(args: &[OsString]) -> Result<Cli, clap::Error> {
    let mut command = accept_negative_numbers(Cli::command());
    let read = command.try_get_matches_from_mut(args).map_err(|error| improve(error, &command, args))?;
    Cli::from_arg_matches(&read).map_err(|error| error.format(&mut command))
}

/// Lets the value of every option be a negative number. Otherwise `--seed -1` is an unknown option `-1` for
/// clap; this way the error says which numbers the option accepts.
fn accept_negative_numbers(command: Command) -> Command {
    let accept = |arg: Arg| {
        let is_option = arg.get_action().takes_values() && !arg.is_positional();
        if is_option { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(accept).mut_subcommands(accept_negative_numbers)
}

/// Suggests the options that have the name of an unknown one as a word: `--actor-lr` and others for `--lr`.
/// clap's own suggestions are names of similar letters; its advice to write `-- --lr` never helps.
fn improve(mut error: clap::Error, command: &Command, args: &[OsString]) -> clap::Error {
    if error.kind() == ErrorKind::InvalidUtf8 {
        return not_text(command, args);
    }
    let unknown = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(unknown)) if error.kind() == ErrorKind::UnknownArgument => unknown.clone(),
        _ => return error,
    };
    let Some(name) = unknown.strip_prefix("--").filter(|name| !name.is_empty()) else { return error };
    if let Some(ContextValue::StyledStrs(advice)) = error.remove(ContextKind::Suggested) {
        let useful = advice.into_iter().filter(|advice| !advice.to_string().contains("as a value"));
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(useful.collect()));
    }
    let of_command = given_command(command, args).get_arguments().filter_map(Arg::get_long);
    let has_word = |option: &&str| option.split('-').any(|word| word == name);
    let mut options: Vec<String> = of_command.filter(has_word).map(|option| format!("--{option}")).collect();
    if let Some(ContextValue::String(similar)) = error.get(ContextKind::SuggestedArg) {
        options.push(similar.clone());
    }
    options.sort();
    options.dedup();
    if !options.is_empty() {
        error.insert(ContextKind::SuggestedArg, ContextValue::Strings(options));
    }
    error
}

/// The first of these options that is given.
pub(super) fn first_given<const N: usize>(options: [(&'static str, bool); N]) -> Option<&'static str> {
    options.into_iter().find_map(|(option, is_given)| is_given.then_some(option))
}

/// A parser of files of one suffix, given without its dot.
pub(super) fn file_ending_in(suffix: &'static str) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |file| match file.extension() {
        Some(found) if found == suffix => Ok(file),
        _ => Err(format!("must end in .{suffix}")),
    })
}

/// An argument that must be text is none: clap does not say which.
fn not_text(command: &Command, args: &[OsString]) -> clap::Error {
    let others = args.iter().skip(1).filter(|arg| arg.to_str().is_none());
    let others: Vec<String> = others.map(|arg| format!("`{}`", arg.to_string_lossy())).collect();
    let message = format!("this command accepts only arguments in UTF-8, got {}", others.join(" and "));
    given_command(command, args).clone().error(ErrorKind::InvalidUtf8, message)
}

/// The innermost command that the arguments name.
fn given_command<'a>(command: &'a Command, args: &[OsString]) -> &'a Command {
    let mut given = command;
    for arg in args.iter().skip(1) {
        given = given.find_subcommand(arg).unwrap_or(given);
    }
    given
}

/// Prints an error of the arguments, or the help that they ask for. Printing fails only if the output is
/// closed.
pub(super) fn print_error(error: &clap::Error, args: &[OsString]) {
    let is_printable = |arg: &OsString| arg.to_str().is_some_and(|text| printable_text(text) == text);
    if args.iter().all(is_printable) {
        let _ = error.print();
    } else {
        err!("{}", printable_text(&error.to_string()).trim_end());
    }
}

const LEVELS: [&str; 6] = ["error", "warn", "info", "debug", "trace", "off"];

/// A part of `--log` is neither a level nor a filter.
#[derive(Debug, thiserror::Error)]
#[error("`{level}` is not a log level; {}", did_you_mean(level, LEVELS))]
pub(super) struct InvalidLevel {
    level: String,
}

/// Reads a level, or filters `TARGET=LEVEL`, separated by commas. `Targets` by itself takes every word for
/// a target, of which it shows all levels, so that a mistyped level hides everything.
pub(super) fn log_filter(text: &str) -> Result<Targets, InvalidLevel> {
    for filter in text.split(',') {
        let level = filter.rsplit_once('=').map_or(filter, |(_, level)| level);
        if LevelFilter::from_str(level).is_err() {
            return Err(InvalidLevel { level: level.to_owned() });
        }
    }
    text.parse().map_err(|_| InvalidLevel { level: text.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(args: &str) -> String {
        let args: Vec<OsString> = args.split(' ').map(OsString::from).collect();
        parse(&args).err().expect("an error").to_string()
    }

    /// `--seed -1` was "unexpected argument '-1' found", with the advice to write `-- -1`, which fails too.
    #[test]
    fn negative_numbers_are_errors_of_their_option() {
        for (args, expected) in [
            (
                "x record 3m --out a.smreplay --seed -1",
                "invalid value '-1' for '--seed <SEED>': must be a whole number",
            ),
            ("x train 3m --out run --steps -5", "'--steps <N>': must be a whole number between 1 and 28147"),
            ("x replay a --to b --episode -1", "'--episode <N>': must be a whole number between 0"),
            ("x watch --port -1", "'--port <PORT>': must be a whole number between 0 and 65535"),
        ] {
            let message = message(args);
            assert!(message.contains(expected) && !message.contains("tip:"), "{args}: {message}");
        }
    }

    /// They were read after the options, with exit status 1.
    #[test]
    fn lanes_sides_and_fields_are_read_with_the_options() {
        for (args, expected) in [
            ("x serve 3m:0", "after `:` must be a whole number between 1 and 1000000"),
            ("x serve a/b=3m", "`a/b` cannot be a name"),
            // `$schema` was among them.
            ("x serve 3m --set foo=1", "unknown key `foo`; expected one of name, num_allied_units"),
            ("x serve 3m --set name", "must be KEY=JSON"),
            ("x serve 3m --sides foo", "sides must be `allies`, `both` or `mirrored`, got `foo`"),
            ("x serve 3m --fields obs,obz", "unknown field `obz`; the fields are env_id"),
        ] {
            let message = message(args);
            assert!(message.contains(expected), "{args}: {message}");
        }
    }

    #[test]
    fn unknown_options_suggest_those_with_the_same_word() {
        for (args, expected) in [
            ("x train 3m --out run --lr 1e-3", "'--actor-lr', '--critic-lr', '--lr-end'"),
            ("x bench 3m --envs 4", "exists: '--num-envs'"),
            ("x train 3m --out run --gama 1", "'--gamma'"),
        ] {
            let message = message(args);
            assert!(message.contains(expected) && !message.contains("as a value"), "{args}: {message}");
        }
        assert!(!message("x watch --json").contains("tip:"));
    }

    /// `--log loud` was accepted as the name of a part of the program, and hid all warnings.
    #[test]
    fn log_levels_are_checked() {
        for text in ["warn", "OFF", "warn,smaclite_pool=debug", "smaclite_ipc::control=trace", ""] {
            assert!(log_filter(text).is_ok(), "{text}");
        }
        for (text, expected) in [
            ("loud", "`loud` is not a log level; expected one of error, warn, info, debug, trace, off"),
            ("debgu", "`debgu` is not a log level; did you mean `debug`?"),
            ("warn,smaclite_pool", "`smaclite_pool` is not a log level"),
            ("smaclite_pool=inf", "did you mean `info`?"),
        ] {
            let error = log_filter(text).expect_err(text).to_string();
            assert!(error.starts_with(expected) || error.ends_with(expected), "{error}");
        }
    }
}

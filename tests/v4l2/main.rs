//! The program against real kernel V4L2 devices, in a virtual machine (see tests/vm). Each group of
//! cases is one boot and one script; what the guest left behind is judged here, case by case.
//!
//! Where the machine cannot be made, the cases count as ignored and a line says so; with `CI` or
//! `ARBORCAM_REQUIRE_VM` set, they fail.

mod camera;
mod faults;
mod guest;
mod live;
mod parity;
mod replug;
mod service;

use guest::{Group, Guest};
use libtest_mimic::{Arguments, Trial};
use std::process::ExitCode;
use std::sync::Arc;

/// A named judgement on what a group left behind.
pub type Case = (&'static str, fn(&guest::Results) -> Result<(), String>);

const GROUPS: &[Group] = &[
    parity::GROUP,
    live::GROUP,
    faults::GROUP,
    replug::GROUP,
    service::GROUP,
];

fn main() -> ExitCode {
    // The same binary plays the USB camera in the guest.
    let args: Vec<String> = std::env::args().collect();
    if args.get(1).is_some_and(|a| a == "usb-camera") {
        return camera::main(&args[2..]);
    }
    let mut args = Arguments::from_args();
    // A guest takes all processors of a small machine, the more so an emulated one: two at a time
    // would film each other's load.
    args.test_threads.get_or_insert(1);
    let guest = if args.list {
        Guest::unused()
    } else {
        Guest::prepare()
    };
    let guest = Arc::new(guest);
    let trials = GROUPS.iter().flat_map(|group| {
        let run = Arc::new(std::sync::OnceLock::new());
        let guest = guest.clone();
        group.cases.iter().map(move |(name, judge)| {
            let (guest, run) = (guest.clone(), run.clone());
            let ignored = guest.is_absent();
            Trial::test(format!("{}::{name}", group.name), move || {
                let results = run.get_or_init(|| guest.run(group));
                results
                    .as_ref()
                    .map_err(Clone::clone)
                    .and_then(|results| judge(results).inspect_err(|_| results.say_stacks()))
                    .map_err(Into::into)
            })
            .with_ignored_flag(ignored)
        })
    });
    let conclusion = libtest_mimic::run(&args, trials.collect());
    guest.say_absent();
    conclusion.exit_code()
}

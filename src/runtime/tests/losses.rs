//! Made-up cameras whose losses are known.

use super::*;
use proptest::prelude::*;

/// Frames as a camera of 30 a second takes them: which are lost, how their times jitter, how they
/// are numbered.
struct Camera<'a> {
    lost: &'a dyn Fn(u64) -> bool,
    /// Off its place by so many intervals.
    jitter: &'a dyn Fn(u64) -> f64,
    /// The number that the driver gives the n-th frame taken, delivered as the m-th.
    number: &'a dyn Fn(u64, u64) -> Option<u64>,
    interval_s: &'a dyn Fn(u64) -> f64,
}

const STEADY: Camera = Camera {
    lost: &|_| false,
    jitter: &|_| 0.0,
    number: &|n, _| Some(n),
    interval_s: &|_| 1.0 / 30.0,
};

/// Runs `frames` of it; gives the totals, the losses there were, and the gaps.
fn run(camera: &Camera, frames: u64) -> (Totals, u64, Vec<Gap>) {
    let mut losses = Losses::new(true, Some(30.0));
    let (mut time_s, mut lost, mut delivered, mut gaps) = (0.0, 0, 0, Vec::new());
    let mut before = Totals::default();
    for n in 0..frames {
        let interval_s = (camera.interval_s)(n);
        time_s += interval_s;
        // What is lost at the very beginning or end nobody can know of.
        if (camera.lost)(n) && n > 0 && n + 1 < frames {
            lost += 1;
            continue;
        }
        let seen_s = time_s + (camera.jitter)(n) * interval_s;
        gaps.extend(
            losses
                .arrived((camera.number)(n, delivered), seen_s, 0)
                .gaps,
        );
        delivered += 1;
        let now = losses.totals();
        assert!(
            now.by_time >= before.by_time && now.reconciled >= before.reconciled,
            "counts only grow"
        );
        assert!(now.by_sequence >= before.by_sequence);
        before = now;
    }
    gaps.extend(losses.finish());
    (losses.totals(), lost, gaps)
}

#[test]
fn each_count_stands_where_the_other_falls() {
    // One in twelve is lost, now and then two or three in a row.
    let some = |n: u64| n % 31 == 7 || n % 53 < 2 && n > 60;
    let late = |n: u64| if n % 10 == 3 { 1.4 } else { 0.0 };
    let none = |_: u64, _: u64| None;
    let delivered_only = |_: u64, m: u64| Some(m);
    let reset = |n: u64, _: u64| if n.is_multiple_of(100) { None } else { Some(n) };
    let cases: [(&str, Camera, [bool; 2]); 6] = [
        ("steady", Camera { ..STEADY }, [true, true]),
        (
            "losses",
            Camera {
                lost: &some,
                ..STEADY
            },
            [true, true],
        ),
        (
            "times that jitter",
            Camera {
                lost: &some,
                jitter: &late,
                ..STEADY
            },
            [true, false],
        ),
        (
            "no numbers",
            Camera {
                lost: &some,
                number: &none,
                ..STEADY
            },
            [false, true],
        ),
        (
            "numbers of what is delivered",
            Camera {
                lost: &some,
                number: &delivered_only,
                ..STEADY
            },
            [false, true],
        ),
        (
            "numbers that begin anew",
            Camera {
                lost: &some,
                number: &reset,
                ..STEADY
            },
            [false, true],
        ),
    ];
    for (name, camera, [numbers, times]) in cases {
        let (totals, lost, gaps) = run(&camera, 900);
        if numbers {
            assert_eq!(totals.by_sequence, Some(lost), "{name}: {totals:?}");
        }
        if times {
            assert_eq!(totals.by_time, lost, "{name}: {totals:?}");
        }
        assert_eq!(totals.reconciled, lost, "{name}: {totals:?}");
        if name != "numbers of what is delivered" {
            assert_eq!(gaps.iter().map(|g| g.missing).sum::<u64>(), lost, "{name}");
        }
        if name == "no numbers" {
            assert_eq!(totals.by_sequence, None);
        }
    }
}

#[test]
fn a_rate_that_exposure_changes_is_no_loss() {
    let none = |_: u64, _: u64| None;
    let slower = |n: u64| {
        if (300..600).contains(&n) {
            1.0 / 15.0
        } else {
            1.0 / 30.0
        }
    };
    let (totals, ..) = run(
        &Camera {
            number: &none,
            interval_s: &slower,
            ..STEADY
        },
        900,
    );
    assert_eq!((totals.by_time, totals.reconciled), (0, 0));
    let creeping = |n: u64| 1.0 / (30.0 - 20.0 * (n as f64 / 900.0));
    let (totals, ..) = run(
        &Camera {
            number: &none,
            interval_s: &creeping,
            ..STEADY
        },
        900,
    );
    assert_eq!(totals.by_time, 0);
}

#[test]
fn frames_that_came_and_were_broken_are_not_lost() {
    let mut losses = Losses::new(true, Some(30.0));
    for n in 0..300u64 {
        if n % 50 == 20 {
            continue;
        }
        let broken = u64::from(n % 50 == 21);
        let arrival = losses.arrived(Some(n), n as f64 / 30.0, broken);
        assert_eq!(arrival.index, n, "it keeps its place");
    }
    losses.finish();
    assert_eq!(
        losses.totals(),
        Totals {
            by_sequence: Some(0),
            by_time: 0,
            reconciled: 0
        }
    );
}

#[test]
fn an_absence_is_a_gap_of_its_true_length_and_no_loss() {
    let mut losses = Losses::new(true, Some(30.0));
    for n in 0..100u64 {
        losses.arrived(Some(n), n as f64 / 30.0, 0);
    }
    losses.away(GapCause::Disconnected);
    // A second attempt that failed after it had begun.
    losses.away(GapCause::Silent);
    let back_s = 99.0 / 30.0 + 4.0;
    let arrival = losses.arrived(Some(0), back_s, 0);
    let [gap] = arrival.gaps.as_slice() else {
        panic!("{arrival:?}")
    };
    assert_eq!(
        (gap.after_frame, gap.missing, arrival.index),
        (99, 119, 219)
    );
    assert!((gap.length_s - 4.0).abs() < 1e-9);
    for n in 1..100u64 {
        losses.arrived(Some(n), back_s + n as f64 / 30.0, 0);
    }
    losses.finish();
    assert_eq!(losses.totals().reconciled, 0);
}

/// Losses at random and times that jitter, both by `seed`: the numbers are exact, and the times
/// right but for a tenth.
fn check_random_losses(seed: u64, percent: u64) -> Result<(), TestCaseError> {
    let hash = |n: u64, salt: u64| {
        let mut x = n.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ seed ^ salt;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    };
    let lost = |n: u64| hash(n, 1) % 100 < percent;
    let jitter = |n: u64| (hash(n, 2) % 1000) as f64 / 3000.0 - 1.0 / 6.0;
    let camera = Camera {
        lost: &lost,
        jitter: &jitter,
        ..STEADY
    };
    let (totals, truth, _) = run(&camera, 600);
    prop_assert_eq!(totals.by_sequence, Some(truth));
    prop_assert_eq!(totals.reconciled, truth);
    let off = totals.by_time.abs_diff(truth);
    prop_assert!(off * 10 <= truth + 20, "{} of {}", totals.by_time, truth);
    Ok(())
}

/// Where so many frames are lost one after another that few steps of one frame are among sixteen,
/// the rate is still known.
#[test]
fn a_run_of_losses_is_no_slower_rate() -> Result<(), TestCaseError> {
    check_random_losses(1_780_979_539_560_061_337, 37)
}

/// Nor is one at the very beginning, where no frames are before it.
#[test]
fn a_run_of_losses_at_the_beginning_is_no_slower_rate() -> Result<(), TestCaseError> {
    check_random_losses(8_458_814_089_425_371_295, 35)
}

proptest! {
    /// Up to 40 % lost at random, and times off by up to a sixth of an interval.
    #[test]
    fn random_losses_are_counted_both_ways(seed in any::<u64>(), percent in 0..41u64) {
        check_random_losses(seed, percent)?;
    }

    /// Whatever comes, nothing panics, the index only grows, and no count goes back.
    #[test]
    fn nothing_that_a_driver_says_upsets_the_counts(
        frames in prop::collection::vec(
            (any::<Option<u64>>(), 0.0..1e6f64, 0..5u64, 0..30u8),
            1..200,
        )
    ) {
        let mut losses = Losses::new(true, Some(30.0));
        let (mut time_s, mut last, mut before) = (0.0, None, Totals::default());
        for (number, step_s, broken, what) in frames {
            if what == 0 {
                losses.away(GapCause::Silent);
            }
            time_s += step_s;
            let arrival = losses.arrived(number.map(|n| n >> 12), time_s, broken);
            prop_assert!(Some(arrival.index) > last);
            last = Some(arrival.index);
            let now = losses.totals();
            prop_assert!(now.by_sequence >= before.by_sequence);
            prop_assert!(now.by_time >= before.by_time);
            prop_assert!(now.reconciled >= before.reconciled);
            before = now;
        }
    }
}

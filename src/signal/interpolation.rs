//! Values between those that were seen.

/// The value at `time` on the straight line between the neighbours of it; before the first and
/// after the last of `times`, which grow, the value there. There must be one.
pub fn linear(times: &[f64], values: &[f64], time: f64) -> f64 {
    let next = times.partition_point(|t| *t < time);
    let after = next.min(times.len() - 1);
    if next == 0 || next == times.len() || times[after] == time {
        return values[after];
    }
    let before = next - 1;
    let share = (time - times[before]) / (times[after] - times[before]);
    values[before] + share.clamp(0.0, 1.0) * (values[after] - values[before])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_values_on_the_line_and_beyond_them_as_the_last() {
        let (times, values) = ([1.0, 2.0, 4.0], [10.0, 20.0, 0.0]);
        let cases = [
            (0.0, 10.0),
            (1.0, 10.0),
            (1.5, 15.0),
            (2.0, 20.0),
            (3.0, 10.0),
            (4.0, 0.0),
            (9.0, 0.0),
        ];
        for (time, wanted) in cases {
            assert_eq!(linear(&times, &values, time), wanted, "at {time}");
        }
    }
}

//! Places where the depth sensor saw nothing, filled from beside.
//!
//! A structured-light sensor leaves a shadow beside every object, on the surface behind it: so of the nearest measured
//! depths to the left and right (or above and below) the farther one is taken. Wide holes stay unknown; what is drawn
//! there is not hidden by anything.

/// Widest hole that is filled, pixels.
const MOST_PX: usize = 40;

/// Fills holes in place. Depth in rows of `columns`, metres along the optical axis; what is not positive is a hole.
pub(super) fn fill(depth_m: &mut [f32], columns: usize) {
    if columns == 0 || !depth_m.len().is_multiple_of(columns) {
        return;
    }
    let rows = depth_m.len() / columns;
    let mut across = vec![0.0; depth_m.len()];
    for row in 0..rows {
        fill_line(depth_m, &mut across, row * columns, 1, columns);
    }
    let mut down = vec![0.0; depth_m.len()];
    for column in 0..columns {
        fill_line(depth_m, &mut down, column, columns, rows);
    }
    for ((depth, across), down) in depth_m.iter_mut().zip(across).zip(down) {
        if !is_measured(*depth) {
            // Projector and camera lie side by side: across is where the shadow's true ground is.
            *depth = if across > 0.0 { across } else { down };
        }
    }
}

pub(super) fn is_measured(depth_m: f32) -> bool {
    depth_m > 0.0 && depth_m.is_finite()
}

/// Writes what a line of pixels says about its holes: the farther end of each.
fn fill_line(depth_m: &[f32], filled: &mut [f32], first: usize, step: usize, count: usize) {
    let mut last: Option<usize> = None;
    for at in 0..=count {
        let measured = at < count && is_measured(depth_m[first + at * step]);
        if !measured && at < count {
            continue;
        }
        let start = last.map_or(0, |last| last + 1);
        if at > start && at - start <= MOST_PX {
            let end = |at: usize| depth_m[first + at * step];
            let farther = match (last, at < count) {
                (Some(last), true) => end(last).max(end(at)),
                (Some(last), false) => end(last),
                (None, true) => end(at),
                (None, false) => 0.0,
            };
            for hole in start..at {
                filled[first + hole * step] = farther;
            }
        }
        last = Some(at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shadow_beside_an_object_becomes_the_surface_behind_it() {
        let nan = f32::NAN;
        let mut row = vec![1.0, 1.0, nan, 0.0, 0.8, 0.8, nan, 0.8, nan];
        fill(&mut row, 9);
        assert_eq!(row, [1.0, 1.0, 1.0, 1.0, 0.8, 0.8, 0.8, 0.8, 0.8]);
    }

    #[test]
    fn a_wide_hole_stays_unknown_and_odd_sizes_are_left_alone() {
        let mut row = vec![0.0; 300];
        row[0] = 1.0;
        row[299] = 1.0;
        fill(&mut row, 300);
        assert_eq!(row.iter().filter(|depth| is_measured(**depth)).count(), 2);
        let mut column = vec![1.0, 0.0, 0.5];
        fill(&mut column, 1);
        assert_eq!(column, [1.0, 1.0, 0.5]);
        let mut odd = vec![0.0; 7];
        fill(&mut odd, 3);
        fill(&mut odd, 0);
        assert_eq!(odd, [0.0; 7]);
    }
}

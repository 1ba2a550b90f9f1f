//! One-to-one assignment with the greatest total gain, over pairs of which most are impossible.
//!
//! Successive shortest augmenting paths with potentials, as in Crouse, "On implementing 2D rectangular assignment algorithms"
//! (2016), on a sparse graph; a row may also stay alone, which gains nothing. Full matrices, as the Hungarian method of `pathfinding` wants
//! them, are out of reach for the thousand tracklets of a shot, whose links are weighed against each other hundreds of times.

use std::{
    cmp::Ordering,
    collections::{BinaryHeap, HashMap, HashSet},
};

/// A pair that may be chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// On one side.
    pub row: usize,
    /// On the other side.
    pub column: usize,
    /// What choosing it is worth; pairs that are worth nothing are never chosen.
    pub gain: f64,
}

/// The column of each row in the assignment with the greatest total gain. Pairs outside of `rows` × `columns` and pairs without
/// a positive, finite gain do not count; of two equal assignments it is always the same one.
#[must_use]
pub fn most_gain(rows: usize, columns: usize, pairs: &[Pair]) -> Vec<Option<usize>> {
    let mut by_row: Vec<Vec<(usize, f64)>> = vec![Vec::new(); rows];
    for pair in pairs.iter().filter(|p| p.column < columns && p.gain.is_finite() && p.gain > 0.0) {
        if let Some(row) = by_row.get_mut(pair.row) {
            row.push((pair.column, -pair.gain));
        }
    }
    // Column `columns + row` stands for staying alone; it costs nothing and nobody else can have it.
    for (row, costs) in by_row.iter_mut().enumerate() {
        costs.push((columns + row, 0.0));
    }
    let mut search = Search {
        costs: by_row,
        row_potential: vec![0.0; rows],
        column_potential: vec![0.0; rows + columns],
        row_of: vec![None; rows + columns],
        column_of: vec![None; rows],
    };
    for row in 0..rows {
        search.augment(row);
    }
    search.column_of.into_iter().map(|column| column.filter(|&c| c < columns)).collect()
}

/// A column and its distance from the row that is being assigned; the nearest comes first out of a heap.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reached {
    distance: f64,
    column: usize,
}

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance.total_cmp(&self.distance).then_with(|| other.column.cmp(&self.column))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The assignment as far as it is made. Every index in it is one of the vectors': it made them all itself.
struct Search {
    costs: Vec<Vec<(usize, f64)>>,
    row_potential: Vec<f64>,
    column_potential: Vec<f64>,
    row_of: Vec<Option<usize>>,
    column_of: Vec<Option<usize>>,
}

impl Search {
    /// Assigns one more row, and moves others where that costs less.
    fn augment(&mut self, start: usize) {
        let mut distance: HashMap<usize, f64> = HashMap::new();
        let mut from: HashMap<usize, usize> = HashMap::new();
        let mut done: Vec<Reached> = Vec::new();
        let mut is_done: HashSet<usize> = HashSet::new();
        let mut heap = BinaryHeap::new();
        let (mut row, mut so_far) = (start, 0.0);
        let free = loop {
            for &(column, cost) in &self.costs[row] {
                let reached = so_far + cost - self.row_potential[row] - self.column_potential[column];
                let nearer = distance.get(&column).is_none_or(|&before| reached < before);
                if nearer && !is_done.contains(&column) {
                    distance.insert(column, reached);
                    from.insert(column, row);
                    heap.push(Reached { distance: reached, column });
                }
            }
            // Every row has a column of its own, so the heap never runs empty before a free one is found.
            let Some(next) = heap.pop() else { return };
            if !is_done.insert(next.column) {
                continue;
            }
            so_far = next.distance;
            done.push(next);
            match self.row_of[next.column] {
                Some(taken) => row = taken,
                None => break next.column,
            }
        };
        self.row_potential[start] += so_far;
        for reached in &done {
            let change = so_far - reached.distance;
            if let Some(row) = self.row_of[reached.column] {
                self.row_potential[row] += change;
            }
            self.column_potential[reached.column] -= change;
        }
        let mut column = free;
        while let Some(&row) = from.get(&column) {
            self.row_of[column] = Some(row);
            match self.column_of[row].replace(column) {
                Some(before) => column = before,
                None => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use pathfinding::prelude::{Matrix, kuhn_munkres};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn somebody_gives_way_when_all_gain() {
        let pair = |row, column, gain| Pair { row, column, gain };
        let pairs = [pair(0, 0, 5.0), pair(0, 1, 4.0), pair(1, 0, 3.0)];
        assert_eq!(most_gain(2, 2, &pairs), [Some(1), Some(0)]);
        // Alone, when giving way would cost more than the other gains.
        let pairs = [pair(0, 0, 5.0), pair(0, 1, 1.0), pair(1, 0, 3.0)];
        assert_eq!(most_gain(2, 2, &pairs), [Some(0), None]);
        assert_eq!(
            most_gain(1, 1, &[pair(0, 0, f64::NAN), pair(0, 0, -1.0), pair(3, 0, 1.0), pair(0, 9, 1.0)]),
            [None]
        );
    }

    proptest! {
        #[test]
        fn the_total_is_that_of_the_full_hungarian_method(
            gains in prop::collection::vec(prop::collection::vec(-300..1000_i64, 7), 1..8),
        ) {
            let pairs: Vec<Pair> = gains
                .iter()
                .enumerate()
                .flat_map(|(row, of_row)| {
                    of_row.iter().enumerate().map(move |(column, gain)| Pair { row, column, gain: *gain as f64 })
                })
                .collect();
            let ours = most_gain(gains.len(), 7, &pairs);
            let mut columns: Vec<usize> = ours.iter().flatten().copied().collect();
            columns.sort_unstable();
            columns.dedup();
            prop_assert_eq!(columns.len(), ours.iter().flatten().count(), "a column twice");
            let total: i64 = ours.iter().enumerate().filter_map(|(row, column)| Some(gains[row][(*column)?])).sum();
            let weights = gains.iter().map(|of_row| of_row.iter().map(|gain| (*gain).max(0)).collect::<Vec<_>>());
            let full = kuhn_munkres(&Matrix::from_rows(weights).unwrap()).0;
            prop_assert_eq!(total, full);
        }
    }
}

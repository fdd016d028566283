//! Orders and groups of the vertices of a pattern: neighbours close together, and compact aggregates.

use crate::assembly::Pattern;

/// Neighbours of every vertex.
pub(super) struct Graph {
    offsets: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Graph {
    pub(super) fn new(pattern: &Pattern) -> Self {
        let mut offsets = vec![0u32];
        let mut neighbours = Vec::with_capacity(2 * pattern.upper_count());
        for row in 0..pattern.rows {
            neighbours.extend(pattern.lower_of(row).iter().map(|l| l[0]));
            neighbours.extend(pattern.upper_of(row).map(|k| pattern.columns[k]));
            offsets.push(neighbours.len() as u32);
        }
        Self { offsets, neighbours }
    }

    fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    fn of(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize]
    }

    /// Sum of index distances of neighbours under an order (`place[vertex]`).
    fn spread(&self, place: &[u32]) -> u64 {
        (0..self.len())
            .flat_map(|v| self.of(v).iter().map(move |&n| u64::from(place[v].abs_diff(place[n as usize]))))
            .sum()
    }

    /// Vertices in an order that keeps neighbours close: as they came, or Cuthill–McKee where that is closer.
    pub(super) fn close_order(&self) -> Vec<u32> {
        let natural: Vec<u32> = (0..self.len() as u32).collect();
        let order = self.cuthill_mckee();
        let mut place = vec![0u32; self.len()];
        for (i, &v) in order.iter().enumerate() {
            place[v as usize] = i as u32;
        }
        if self.spread(&place) < self.spread(&natural) { order } else { natural }
    }

    fn cuthill_mckee(&self) -> Vec<u32> {
        let mut order = Vec::with_capacity(self.len());
        let mut seen = vec![false; self.len()];
        for root in 0..self.len() {
            if seen[root] {
                continue;
            }
            let start = self.farthest(self.farthest(root));
            seen[start] = true;
            let mut head = order.len();
            order.push(start as u32);
            while head < order.len() {
                let vertex = order[head] as usize;
                head += 1;
                let first = order.len();
                for &n in self.of(vertex) {
                    if !std::mem::replace(&mut seen[n as usize], true) {
                        order.push(n);
                    }
                }
                order[first..].sort_by_key(|&n| self.of(n as usize).len());
            }
        }
        order
    }

    /// Last vertex that a breadth-first walk from `root` reaches.
    fn farthest(&self, root: usize) -> usize {
        let mut seen = vec![false; self.len()];
        seen[root] = true;
        let mut queue = vec![root as u32];
        let mut head = 0;
        while head < queue.len() {
            let vertex = queue[head] as usize;
            head += 1;
            for &n in self.of(vertex) {
                if !std::mem::replace(&mut seen[n as usize], true) {
                    queue.push(n);
                }
            }
        }
        queue[queue.len() - 1] as usize
    }

    /// At most `limit` compact aggregates (more if the graph has more pieces): the aggregate of every vertex, and their
    /// number. Seeds are as many hops apart as it takes, found along `order`; every vertex joins its nearest seed.
    pub(super) fn aggregates(&self, order: &[u32], limit: usize) -> (Vec<u32>, usize) {
        let mut seeds = Vec::new();
        for hops in 1..=64 {
            seeds = self.seeds(order, hops);
            if seeds.len() <= limit {
                break;
            }
        }
        let mut aggregate = vec![u32::MAX; self.len()];
        for (a, &seed) in seeds.iter().enumerate() {
            aggregate[seed as usize] = a as u32;
        }
        let mut queue = seeds.clone();
        let mut head = 0;
        while head < queue.len() {
            let vertex = queue[head] as usize;
            head += 1;
            for &n in self.of(vertex) {
                if aggregate[n as usize] == u32::MAX {
                    aggregate[n as usize] = aggregate[vertex];
                    queue.push(n);
                }
            }
        }
        (aggregate, seeds.len())
    }

    /// Vertices more than `hops` edges apart from each other that leave none farther than that from the nearest.
    fn seeds(&self, order: &[u32], hops: usize) -> Vec<u32> {
        let mut covered = vec![false; self.len()];
        let mut stamp = vec![u32::MAX; self.len()];
        let mut seeds = Vec::new();
        let mut ring = Vec::new();
        let mut next = Vec::new();
        for vertex in order.iter().map(|&v| v as usize) {
            if covered[vertex] {
                continue;
            }
            let id = seeds.len() as u32;
            seeds.push(vertex as u32);
            (covered[vertex], stamp[vertex]) = (true, id);
            ring.clear();
            ring.push(vertex as u32);
            for _ in 0..hops {
                next.clear();
                for &v in &ring {
                    for &n in self.of(v as usize) {
                        if std::mem::replace(&mut stamp[n as usize], id) != id {
                            covered[n as usize] = true;
                            next.push(n);
                        }
                    }
                }
                std::mem::swap(&mut ring, &mut next);
            }
        }
        seeds
    }
}

//! Declarations that need each other: how deep they are nested, and how large they are with all copies written out.

/// One declaration.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Node {
    /// First byte.
    pub at: usize,
    /// Nesting of its own.
    pub depth: u64,
    /// Tokens of its own.
    pub tokens: u64,
    /// How often it names `array`.
    pub arrays: u64,
    /// Whether each declaration that uses it gets a copy of its value.
    pub copied: bool,
    /// Whether it is a type: its values may have many parts.
    pub is_type: bool,
}

/// The most tokens that a use of a scalar, vector or matrix counts as: such values are computed, and then copied.
const COMPUTED: u64 = 32;

/// Depth and size of a declaration with all that it needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Reach {
    /// Nesting, with that of all that it needs.
    pub depth: u64,
    /// Tokens, with those of all copies in it.
    pub size: u64,
    /// Whether its value may have more parts than a matrix.
    large: bool,
}

/// Declarations, and which of them each one needs.
#[derive(Debug, Default)]
pub(super) struct Graph {
    pub nodes: Vec<Node>,
    /// User, used, and whether it stands in the user's text. One for each mention.
    edges: Vec<(u32, u32, bool)>,
}

impl Graph {
    /// A new declaration.
    pub fn add(&mut self, at: usize) -> u32 {
        self.nodes.push(Node { at, ..Node::default() });
        (self.nodes.len() - 1) as u32
    }

    /// One mentions another.
    pub fn uses(&mut self, user: u32, used: u32) {
        self.edges.push((user, used, true));
    }

    /// One is a part of another.
    pub fn needs(&mut self, user: u32, used: u32) {
        self.edges.push((user, used, false));
    }

    /// Depth and size of each. Declarations that need each other in a circle are not a valid shader, or they only seem to need each other:
    /// a member or variable may have the name of a function. They count as one declaration that is as deep as all of them together.
    pub fn reaches(&self) -> Vec<Reach> {
        let n = self.nodes.len();
        // Edges by their user.
        let mut first = vec![0u32; n + 1];
        for &(user, ..) in &self.edges {
            first[user as usize + 1] += 1;
        }
        for k in 0..n {
            first[k + 1] += first[k];
        }
        let mut next = first.clone();
        let mut targets = vec![(0u32, false); self.edges.len()];
        for &(user, used, mention) in &self.edges {
            targets[next[user as usize] as usize] = (used, mention);
            next[user as usize] += 1;
        }
        // Tarjan's strongly connected components, without recursion: each comes after those that it needs.
        const NEW: u32 = u32::MAX;
        let (mut number, mut low) = (vec![NEW; n], vec![0u32; n]);
        let mut done: Vec<Option<Reach>> = vec![None; n];
        let (mut stack, mut path, mut count) = (Vec::new(), Vec::new(), 0);
        let mut at: Vec<u32> = first[..n].to_vec();
        for root in 0..n {
            if number[root] == NEW {
                path.push(root);
            }
            while let Some(&v) = path.last() {
                if number[v] == NEW {
                    (number[v], low[v]) = (count, count);
                    count += 1;
                    stack.push(v);
                }
                if at[v] < first[v + 1] {
                    let w = targets[at[v] as usize].0 as usize;
                    at[v] += 1;
                    if number[w] == NEW {
                        path.push(w);
                    } else if done[w].is_none() {
                        low[v] = low[v].min(number[w]);
                    }
                    continue;
                }
                path.pop();
                if let Some(&parent) = path.last() {
                    low[parent] = low[parent].min(low[v]);
                }
                if low[v] == number[v] {
                    let from = stack.iter().rposition(|&w| w == v).unwrap_or(0);
                    let members = stack.split_off(from);
                    self.close(&members, &first, &targets, &mut done);
                }
            }
        }
        done.into_iter().map(Option::unwrap_or_default).collect()
    }

    /// The reach of the members of a circle, or of one declaration.
    fn close(&self, members: &[usize], first: &[u32], targets: &[(u32, bool)], done: &mut [Option<Reach>]) {
        let own: u64 = members.iter().map(|&v| self.nodes[v].depth).sum();
        let mut below = 0;
        let mut sizes = Vec::with_capacity(members.len());
        for &v in members {
            let mut size = self.nodes[v].tokens;
            let mut large = self.nodes[v].arrays > 0;
            for &(w, mention) in &targets[first[v] as usize..first[v + 1] as usize] {
                let Some(reach) = done[w as usize] else { continue };
                below = below.max(reach.depth);
                let used = self.nodes[w as usize];
                // A type counts with all its parts.
                if used.is_type && self.nodes[v].is_type {
                    size = size.saturating_add(reach.size);
                } else if mention && used.copied {
                    size = size.saturating_add(if reach.large { reach.size } else { reach.size.min(COMPUTED) });
                }
                large |= used.is_type || (used.copied && reach.large);
            }
            sizes.push((size, large));
        }
        for (&v, (size, large)) in members.iter().zip(sizes) {
            done[v] = Some(Reach { depth: own.saturating_add(below), size, large });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(nodes: &[(u64, u64, bool)], edges: &[(u32, u32)]) -> Graph {
        let mut graph = Graph::default();
        for &(depth, tokens, copied) in nodes {
            let node = graph.add(0);
            graph.nodes[node as usize] = Node { depth, tokens, copied, arrays: 1, ..Node::default() };
        }
        edges.iter().for_each(|&(user, used)| graph.uses(user, used));
        graph
    }

    #[test]
    fn depths_add_up_and_copies_multiply() {
        // 0 mentions 1 twice, 1 mentions 2 twice and 3.
        let g = graph(&[(1, 10, false), (2, 5, true), (4, 3, true), (8, 7, false)], &[(0, 1), (0, 1), (1, 2), (1, 3), (1, 2)]);
        let reach = |depth, size| Reach { depth, size, large: true };
        assert_eq!(g.reaches(), [reach(11, 32), reach(10, 11), reach(4, 3), reach(8, 7)]);
    }

    #[test]
    fn circles_are_one() {
        let g = graph(&[(1, 1, true), (2, 1, true), (3, 1, true), (4, 9, true)], &[(0, 1), (1, 2), (2, 0), (2, 3), (3, 3)]);
        let depths: Vec<u64> = g.reaches().iter().map(|r| r.depth).collect();
        assert_eq!(depths, [10, 10, 10, 4]);
    }

    #[test]
    fn long_chains_take_no_stack_and_saturate() {
        let n = 200_000;
        let nodes = vec![(1, 1, true); n];
        let edges: Vec<(u32, u32)> = (0..n as u32 - 1).flat_map(|k| [(k, k + 1), (k, k + 1)]).collect();
        let reaches = graph(&nodes, &edges).reaches();
        assert_eq!(reaches[0], Reach { depth: n as u64, size: u64::MAX, large: true });
        assert_eq!(reaches[n - 3], Reach { depth: 3, size: 7, large: true });
    }

    #[test]
    fn what_is_computed_does_not_multiply() {
        let n = 300;
        let mut g = graph(&vec![(1, 5, true); n], &(0..n as u32 - 1).map(|k| (k, k + 1)).collect::<Vec<_>>());
        g.nodes.iter_mut().for_each(|node| node.arrays = 0);
        assert!(g.reaches().iter().all(|reach| reach.size <= 5 + COMPUTED && !reach.large));
        // Values of a type may have any number of parts.
        g.nodes[n - 1].is_type = true;
        assert_eq!(g.reaches()[0].size, 5 * (n as u64 - 1) + 5);
    }
}

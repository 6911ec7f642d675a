//! Sets of agents.

use msgs::ids::AgentId;
use voxels::bits_of;

/// A set of agents, one bit each.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct AgentSet {
    words: Vec<u64>,
}

impl AgentSet {
    /// These agents. Equal sets are equal in any order.
    pub(super) fn of(agents: impl IntoIterator<Item = AgentId>) -> Self {
        let mut set = Self::default();
        agents.into_iter().for_each(|agent| set.insert(agent));
        set
    }

    /// Adds an agent.
    pub(super) fn insert(&mut self, agent: AgentId) {
        let word = agent.index() / 64;
        if word >= self.words.len() {
            self.words.resize(word + 1, 0);
        }
        self.words[word] |= 1 << (agent.index() % 64);
    }

    /// Whether an agent is one of them.
    pub(super) fn contains(&self, agent: AgentId) -> bool {
        self.words.get(agent.index() / 64).is_some_and(|word| word >> (agent.index() % 64) & 1 != 0)
    }

    /// Removes the agents of another set, and returns those that were in both.
    pub(super) fn take(&mut self, others: &Self) -> Self {
        let both = self.words.iter_mut().zip(&others.words).map(|(word, others)| {
            let both = *word & others;
            *word ^= both;
            both
        });
        Self { words: both.collect() }
    }

    /// Removes an agent.
    pub(super) fn remove(&mut self, agent: AgentId) {
        if let Some(word) = self.words.get_mut(agent.index() / 64) {
            *word &= !(1 << (agent.index() % 64));
        }
    }

    /// Adds the agents of another set.
    pub(super) fn extend(&mut self, others: &Self) {
        if others.words.len() > self.words.len() {
            self.words.resize(others.words.len(), 0);
        }
        self.words.iter_mut().zip(&others.words).for_each(|(word, others)| *word |= others);
    }

    /// Whether it has no agents.
    pub(super) fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// Number of agents.
    pub(super) fn len(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The agents, ascending.
    pub(super) fn iter(&self) -> impl Iterator<Item = AgentId> + '_ {
        bits_of(&self.words).map(AgentId::from_index)
    }
}

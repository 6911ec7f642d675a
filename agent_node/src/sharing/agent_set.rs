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

    fn insert(&mut self, agent: AgentId) {
        let word = agent.index() / 64;
        if word >= self.words.len() {
            self.words.resize(word + 1, 0);
        }
        self.words[word] |= 1 << (agent.index() % 64);
    }

    /// The agents that are not in another set.
    pub(super) fn without(&self, other: &Self) -> Self {
        let others = other.words.iter().copied().chain(std::iter::repeat(0));
        let mut words: Vec<u64> = self.words.iter().zip(others).map(|(word, other)| word & !other).collect();
        words.truncate(words.iter().rposition(|&word| word != 0).map_or(0, |last| last + 1));
        Self { words }
    }

    /// These agents and one more.
    pub(super) fn with(&self, agent: AgentId) -> Self {
        let mut set = self.clone();
        set.insert(agent);
        set
    }

    /// Whether an agent is one of them.
    pub(super) fn contains(&self, agent: AgentId) -> bool {
        self.words.get(agent.index() / 64).is_some_and(|word| word >> (agent.index() % 64) & 1 != 0)
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

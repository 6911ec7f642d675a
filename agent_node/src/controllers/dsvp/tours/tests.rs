use voxels::Cell;

use super::*;
use crate::controllers::settings::Settings;
use crate::exploration_map::drawing::drawn;
use crate::path::{Graph, Moves, Neighbours};

/// A gallery of two blocks of the task grid, with openings to both sides.
const GALLERY: &str = "
#####?##########################################################?#####
#....................................................................#
#####?##########################################################?#####
######################################################################";

const IDS: [AgentId; 2] = [AgentId(0), AgentId(1)];

/// Two agents in the gallery that know the same map.
struct Pair {
    map: ExplorationMap,
    graph: AbstractGraph,
    tours: [Tours; 2],
    cells: [Cell; 2],
    now: Tick,
}

impl Pair {
    fn new(cells: [Cell; 2]) -> Self {
        let map = drawn(GALLERY.trim_start());
        let mut graph = AbstractGraph::new(map.extent(), 0.4);
        graph.update(Graph::new(&map, &Moves::new(0.4, 1.0, Neighbours::TwentySix)));
        let settings = ["promising_min=0", "cut_s=0", "visit_s=10"].map(str::to_owned);
        let mut settings = Settings::parse(&settings).unwrap();
        let params = ToursParams::from_settings(&mut settings).unwrap();
        let tours = IDS.map(|agent| Tours::new(params, agent, 2, map.extent()));
        Self { map, graph, tours, cells, now: Tick::ZERO }
    }

    /// A decision of both agents, of which those messages arrive that `arrives`.
    fn step(&mut self, arrives: impl Fn(AgentId) -> bool) {
        self.now = self.now.after(5);
        let mut inboxes = [Vec::new(), Vec::new()];
        for (agent, tours) in self.tours.iter_mut().enumerate() {
            let other = 1 - agent;
            let contacts = [Contact { agent: IDS[other], position: self.map.extent().centre(self.cells[other]) }];
            let mut paths = ShortestPaths::default();
            let likelihood = Likelihood::new(1.0);
            let place = (self.cells[agent], &contacts[..]);
            tours.update((&self.map, &self.graph, &mut paths), place, (&BTreeSet::new(), likelihood), self.now);
            tours.negotiate((&self.graph, &mut paths), place, self.now);
            for AgentMessage { kind, data, .. } in tours.messages(&contacts, self.now) {
                if arrives(IDS[agent]) {
                    inboxes[other].push(ReceivedMessage { from: IDS[agent], kind, data });
                }
            }
        }
        for (tours, inbox) in self.tours.iter_mut().zip(inboxes) {
            tours.receive(&inbox, self.now.next());
        }
    }

    /// Whether each agent has the task at a cell.
    fn holds(&self, cell: Cell) -> [bool; 2] {
        [0, 1].map(|agent| self.tours[agent].is_own(&self.graph, cell))
    }
}

/// Steps until the second division: the first one is refused, since both agents have just learned
/// of each other.
const STEPS: usize = 40;

const LEFT: Cell = Cell { x: 5, y: 2, z: 0 };
const RIGHT: Cell = Cell { x: 64, y: 2, z: 0 };

#[test]
fn agents_that_meet_share_the_tasks_out() {
    let mut pair = Pair::new([Cell::new(30, 2, 0), Cell::new(40, 2, 0)]);
    for _ in 0..STEPS {
        pair.step(|_| true);
    }
    assert_eq!([pair.holds(LEFT), pair.holds(RIGHT)], [[true, false], [false, true]]);
    let tasks = |pair: &Pair| [0, 1].map(|agent| pair.tours[agent].ledger.own_record().unwrap().tasks.clone());
    let before = tasks(&pair);
    for _ in 0..STEPS {
        pair.step(|_| true);
    }
    assert_eq!(tasks(&pair), before, "an agreed division stays");
}

#[test]
fn relocation_prefers_own_tasks() {
    let mut pair = Pair::new([Cell::new(30, 2, 0), Cell::new(40, 2, 0)]);
    for _ in 0..STEPS {
        pair.step(|_| true);
    }
    let tours = &pair.tours[0];
    let region = |cell| pair.graph.region_listing(cell).unwrap();
    let penalty_m = |cell, path_m| tours.penalty_m(region(cell), path_m, 0.0, pair.now);
    assert_eq!(penalty_m(LEFT, 30.0), 0.0);
    assert_eq!(penalty_m(RIGHT, 40.0), 80.0, "agent 1 will be there sooner");
    assert_eq!(penalty_m(RIGHT, 1.0), 0.0, "but not if this one is there at once");
}

#[test]
fn without_messages_each_agent_has_all_tasks() {
    let mut pair = Pair::new([Cell::new(30, 2, 0), Cell::new(40, 2, 0)]);
    for _ in 0..6 {
        pair.step(|_| false);
    }
    assert_eq!([pair.holds(LEFT), pair.holds(RIGHT)], [[true, true], [true, true]]);
}

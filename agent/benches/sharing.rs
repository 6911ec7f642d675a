//! Wall time of one map exchange of an agent: it merges the messages of all others and sends them
//! what is new since the last exchange. 20 agents, all in contact, in a cave of 100^3 cells; run
//! with `cargo bench -p agent_node --no-default-features --bench sharing`.
//!
//! Period 1 is the first contact after 5 scans of each agent; in later periods each agent adds 5
//! scans along a path of 5 cells. The bench also prints the bytes and cells that all agents send in
//! each period, and the bytes that plain lists of runs of cell indices would take.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::ops::ControlFlow;

use agent::command::{AgentMessage, Peer};
use agent::exploration_map::{Change, ExplorationMap};
use agent::observation::Contact;
use agent::sharing::{DEFAULT_PERIOD_TICKS, Sharing};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use msgs::ids::{AgentId, Tick};
use nalgebra::{Point3, Vector3};
use protocol::limits::AGENT_MESSAGE_BYTES_MAX;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::{Cell, Extent, Grid, Terrain, keep_largest_component, walk};

const SIDE: u32 = 100;
const AGENTS: u32 = 20;
const RAYS: u32 = 5124;
const STEPS: usize = 5;

/// Spheres with radii of 3 to 8 cells in rock until a third of the map is free; only the largest
/// connected component is kept.
fn cave(rng: &mut ChaCha8Rng) -> Grid<Terrain> {
    let extent = Extent::new([SIDE; 3], 1.0).expect("a legal size");
    let mut terrain = Grid::new(extent, Terrain::Wall);
    let mut free = 0;
    while free * 3 < extent.volume() {
        let radius = rng.random_range(3..=8);
        let mut along = || rng.random_range(radius + 2..SIDE as i32 - radius - 2);
        let centre = Cell::new(along(), along(), along());
        let ball = (-radius..=radius)
            .flat_map(|z| (-radius..=radius).flat_map(move |y| (-radius..=radius).map(move |x| Cell::new(x, y, z))));
        for offset in ball.filter(|cell| cell.x * cell.x + cell.y * cell.y + cell.z * cell.z <= radius * radius) {
            free += usize::from(terrain.set(centre + offset, Terrain::Free) == Some(Terrain::Wall));
        }
    }
    keep_largest_component(&mut terrain);
    terrain
}

/// Directions spread evenly over the sphere.
fn directions() -> Vec<Vector3<f64>> {
    let golden = 0.5 + 1.25f64.sqrt();
    let direction = |ray: u32| {
        let z = 1.0 - 2.0 * (f64::from(ray) + 0.5) / f64::from(RAYS);
        let (sin, cos) = libm::sincos(TAU * f64::from(ray) / golden);
        let flat = (1.0 - z * z).sqrt();
        Vector3::new(cos * flat, sin * flat, z)
    };
    (0..RAYS).map(direction).collect()
}

fn scan(terrain: &Grid<Terrain>, from: Cell, directions: &[Vector3<f64>], map: &mut ExplorationMap) {
    let extent = terrain.extent();
    let (mut free, mut wall) = (BTreeSet::new(), BTreeSet::new());
    for direction in directions {
        let _ = walk(extent, &extent.centre(from), direction, f64::INFINITY, |cell, _| {
            let Some(index) = extent.index(cell) else { return ControlFlow::Break(()) };
            let is_wall = terrain[index] == Terrain::Wall;
            if is_wall { &mut wall } else { &mut free }.insert(index as u32);
            if is_wall { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }
    map.note_free(&free.into_iter().collect::<Vec<_>>());
    map.note_wall(&wall.into_iter().collect::<Vec<_>>());
    map.note_covered(from);
}

#[derive(Clone)]
struct Agent {
    map: ExplorationMap,
    sharing: Sharing,
    received: Vec<AgentMessage>,
}

impl Agent {
    fn exchange(&mut self, contacts: &[Contact], now: Tick) -> Vec<AgentMessage> {
        self.sharing.incoming(&mut self.map, &self.received);
        self.sharing.outgoing(&self.map, contacts, now, AGENT_MESSAGE_BYTES_MAX)
    }
}

fn contacts(agent: u32) -> Vec<Contact> {
    let contact = |other| Contact { agent: AgentId(other), position: Point3::origin() };
    (0..AGENTS).filter(|&other| other != agent).map(contact).collect()
}

/// One exchange of all agents with all others; the bytes and messages sent.
fn round(agents: &mut [Agent], now: Tick) -> (usize, usize) {
    let (mut bytes, mut messages) = (0, 0);
    let mut posted = Vec::new();
    for (id, agent) in (0..).zip(&mut *agents) {
        for message in agent.exchange(&contacts(id), now) {
            assert_eq!(message.peer, Peer::Broadcast, "all messages are broadcasts");
            bytes += message.data.len();
            messages += 1;
            posted.push(AgentMessage { peer: Peer::One(AgentId(id)), kind: message.kind, data: message.data });
        }
        agent.received.clear();
    }
    for (id, agent) in (0..).zip(agents) {
        agent.received.extend(posted.iter().filter(|message| message.peer != Peer::One(AgentId(id))).cloned());
    }
    (bytes, messages)
}

fn explore(agents: &mut [Agent], terrain: &Grid<Terrain>, places: &mut [Cell], directions: &[Vector3<f64>]) -> usize {
    let before: usize = agents.iter().map(|agent| agent.map.journal_len()).sum();
    for step in 0..STEPS {
        for (id, (agent, place)) in agents.iter_mut().zip(places.iter_mut()).enumerate() {
            let faces = place.neighbours6();
            let is_free = |cell: &&Cell| terrain.get(**cell) == Some(&Terrain::Free);
            *place = faces.iter().cycle().skip((id + step) % 6).take(6).find(is_free).copied().unwrap_or(*place);
            scan(terrain, *place, directions, &mut agent.map);
        }
    }
    agents.iter().map(|agent| agent.map.journal_len()).sum::<usize>() - before
}

/// Size of the changes as plain lists of runs of cell indices, two LEB128 numbers each, bytes.
fn bytes_as_runs(changes: impl Iterator<Item = Change>) -> usize {
    let mut lists = [const { Vec::new() }; 4];
    changes.for_each(|change| lists[change.finding as usize].push(change.cell));
    let number_bytes = |number: u32| (u32::BITS - number.leading_zeros()).div_ceil(7).max(1) as usize;
    let list_bytes = |mut cells: Vec<u32>| {
        cells.sort_unstable();
        let mut next = 0;
        let runs = cells.chunk_by(|one, other| one + 1 == *other).map(|run| {
            let gap = run[0] - next;
            next = run[0] + run.len() as u32;
            number_bytes(gap) + number_bytes(run.len() as u32 - 1)
        });
        runs.sum::<usize>()
    };
    lists.into_iter().map(list_bytes).sum()
}

#[expect(clippy::print_stdout, reason = "the sizes belong to the times")]
fn exchange(criterion: &mut Criterion) {
    let mut rng = voxels::random_streams::stream(7, 0, "bench.cave");
    let terrain = cave(&mut rng);
    let directions = directions();
    let free: Vec<Cell> = terrain.iter().filter(|&(_, &is)| is == Terrain::Free).map(|(cell, _)| cell).collect();
    let mut places: Vec<Cell> = (0..AGENTS).map(|_| free[rng.random_range(0..free.len())]).collect();
    let agent = |id| Agent {
        map: ExplorationMap::new(terrain.extent()),
        sharing: Sharing::new(AgentId(id), DEFAULT_PERIOD_TICKS, AGENTS),
        received: Vec::new(),
    };
    let mut agents: Vec<Agent> = (0..AGENTS).map(agent).collect();
    let mut group = criterion.benchmark_group("exchange of one agent with 19 others");
    for period in 0..8 {
        let known: Vec<usize> = agents.iter().map(|agent| agent.map.journal_len()).collect();
        let new_cells = explore(&mut agents, &terrain, &mut places, &directions);
        let own = agents.iter().zip(known).map(|(agent, known)| bytes_as_runs(agent.map.changes_since(known)));
        let as_runs: usize = own.sum();
        // Summaries, and then the updates that reply to them.
        let summaries = Tick(period * u64::from(DEFAULT_PERIOD_TICKS));
        let now = summaries.next();
        round(&mut agents, summaries);
        if [1, 2, 4, 7].contains(&period) {
            let mut one = agents[0].clone();
            let known = one.map.journal_len();
            one.sharing.incoming(&mut one.map, &one.received);
            let name = format!("period {period}, {} cells received", one.map.journal_len() - known);
            let contacts = contacts(0);
            group.bench_function(name, |bencher| {
                let start = || agents[0].clone();
                let routine = |agent: &mut Agent| black_box(agent.exchange(&contacts, now));
                bencher.iter_batched_ref(start, routine, BatchSize::PerIteration);
            });
        }
        let (bytes, messages) = round(&mut agents, now);
        println!(
            "period {period}: {new_cells} cells found, sent in {bytes} bytes and {messages} messages; \
             {:.1} bytes for 100 cells, as runs {:.1}: ratio {:.2}",
            100.0 * bytes as f64 / new_cells as f64,
            100.0 * as_runs as f64 / new_cells as f64,
            as_runs as f64 / bytes as f64,
        );
    }
}

criterion_group!(benches, exchange);
criterion_main!(benches);

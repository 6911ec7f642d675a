use nalgebra::Point3;
use proptest::prelude::*;
use voxels::{Cell, Extent};

use super::*;
use crate::exploration_map::{CellState, Change, Delta, Finding};

const BUDGET: usize = PARCEL_BYTES_MAX;

/// Agents with their maps, and a world that delivers their messages.
struct Team {
    maps: Vec<ExplorationMap>,
    sharings: Vec<Sharing>,
    inboxes: Vec<Vec<ReceivedMessage>>,
    /// Cells sent so far: from, to, cell, finding.
    delivered: Vec<(u32, u32, u32, u8)>,
}

impl Team {
    fn new(agents: u32, extent: Extent, period: u32) -> Self {
        let count = agents as usize;
        Self {
            maps: vec![ExplorationMap::new(extent); count],
            sharings: (0..agents).map(|id| Sharing::new(AgentId(id), period, agents)).collect(),
            inboxes: vec![Vec::new(); count],
            delivered: Vec::new(),
        }
    }

    /// One tick with the pairs of agents in contact; the bytes that each of them sent.
    fn tick(&mut self, now: u64, pairs: &[(u32, u32)], budget: usize) -> Vec<usize> {
        let mut sent = vec![0; self.maps.len()];
        let mut posted = Vec::new();
        for agent in 0..self.maps.len() as u32 {
            let index = agent as usize;
            let received = std::mem::take(&mut self.inboxes[index]);
            let report = self.sharings[index].incoming(&mut self.maps[index], &received);
            assert_eq!(report.refused, []);
            let contacts = contacts(agent, pairs);
            check_news(&self.sharings[index], &self.maps[index], &contacts, budget);
            let messages = self.sharings[index].outgoing(&self.maps[index], &contacts, Tick(now), budget);
            sent[index] = messages.iter().map(|message| message.data.len()).sum();
            assert!(sent[index] + messages.len() * PARCEL_BYTES_BARE <= budget);
            for AgentMessage { to, kind, data } in messages {
                let in_contact: Vec<AgentId> = contacts.iter().map(|contact| contact.agent).collect();
                let receivers = to.map_or(in_contact, |to| vec![to]);
                let extent = self.maps[index].extent();
                let (named, delta) = map_message::decode(&data, extent, self.maps.len() as u32).unwrap();
                for &receiver in &receivers {
                    // A broadcast for many reaches all.
                    let is_named = named.contains(&receiver);
                    assert!(is_named || to.is_none() && named.len() > ADDRESSED_MAX);
                    if is_named {
                        let findings = delta.findings(extent);
                        self.delivered.extend(findings.map(|(cell, finding)| (agent, receiver.0, cell, finding as u8)));
                    }
                    posted.push((receiver, ReceivedMessage { from: AgentId(agent), kind, data: data.clone() }));
                }
            }
        }
        for (receiver, message) in posted {
            self.inboxes[receiver.index()].push(message);
        }
        sent
    }

    fn sent_cells(&self, from: u32, to: u32) -> Vec<u32> {
        let of_pair = self.delivered.iter().filter(|delivered| (delivered.0, delivered.1) == (from, to));
        let mut cells: Vec<u32> = of_pair.map(|delivered| delivered.2).collect();
        cells.sort_unstable();
        cells
    }

    fn states(&self, agent: usize) -> Vec<CellState> {
        let map = &self.maps[agent];
        map.extent().cells().map(|cell| map.state(cell)).collect()
    }

    fn trigger(&self, agent: u32, pairs: &[(u32, u32)], now: u64) -> Trigger {
        self.sharings[agent as usize].next_trigger(&contacts(agent, pairs), Tick(now))
    }
}

/// Compares the news for peers that are sent all of the journal with what a search cell by cell
/// finds.
fn check_news(sharing: &Sharing, map: &ExplorationMap, contacts: &[Contact], budget: usize) {
    let mut sharing = sharing.clone();
    for contact in contacts {
        peer(&mut sharing.peers, contact.agent).until = map.journal_len();
    }
    for (budget, cell_bits) in [(BUDGET, 2), (budget, 2), (500, 40)] {
        assert_eq!(sharing.news(contacts, budget, cell_bits), plain_news(&sharing, contacts, budget, cell_bits));
    }
}

/// What [`Sharing::news`] is to find.
fn plain_news(sharing: &Sharing, contacts: &[Contact], mut budget: usize, cell_bits: usize) -> Option<(News, usize)> {
    let waits = |agent: AgentId| sharing.peers.get(agent.index()).filter(|peer| peer.cursor < peer.until);
    let waiting: Vec<AgentId> =
        contacts.iter().map(|contact| contact.agent).filter(|&agent| waits(agent).is_some()).collect();
    let is_exchanging =
        |agent: AgentId, at: usize| waits(agent).is_some_and(|peer| (peer.cursor..peer.until).contains(&at));
    let lacks = |agent: AgentId, at: usize| {
        let holds = |provenance: &Provenance| provenance.holders.iter().any(|holder| holder == agent);
        let heard = sharing.provenances.iter().find(|provenance| provenance.positions.contains(&at));
        is_exchanging(agent, at) && !heard.is_some_and(holds)
    };
    let is_edge = |at: usize| {
        let is_end = |range: Range<usize>| range.start == at || range.end == at;
        sharing.provenances.iter().any(|provenance| is_end(provenance.positions.clone()))
            || waiting.iter().filter_map(|&agent| waits(agent)).any(|peer| is_end(peer.cursor..peer.until))
    };
    let start = waiting.iter().filter_map(|&agent| waits(agent)).map(|peer| peer.cursor).min()?;
    let last = waiting.iter().filter_map(|&agent| waits(agent)).map(|peer| peer.until).max()?;
    let (mut at, mut news) = (start, News::new());
    while at < last {
        let end = (at + 1..=last).find(|&at| is_edge(at)).unwrap_or(last);
        let mut receivers: Vec<AgentId> = waiting.iter().copied().filter(|&agent| lacks(agent, at)).collect();
        if receivers.is_empty() {
            at = end;
            continue;
        }
        if is_crowd(contacts) {
            receivers = waiting.iter().copied().filter(|&agent| is_exchanging(agent, at)).collect();
        }
        let copies = copies(receivers.len(), contacts);
        let is_begun = news.contains_key(&receivers);
        let bare = if is_begun { 0 } else { map_message::bare_bytes_max(receivers.len()) + PARCEL_BYTES_BARE };
        let taken = (end - at).min(8 * budget.saturating_sub(copies * bare) / (copies * cell_bits));
        if taken == 0 {
            break;
        }
        budget -= copies * bare + (taken * copies * cell_bits).div_ceil(8);
        news.entry(receivers).or_default().push(at..at + taken);
        at += taken;
    }
    (at > start).then_some((news, at))
}

fn contacts(agent: u32, pairs: &[(u32, u32)]) -> Vec<Contact> {
    let mut others: Vec<u32> = pairs
        .iter()
        .filter_map(|&(one, other)| match agent {
            _ if agent == one => Some(other),
            _ if agent == other => Some(one),
            _ => None,
        })
        .collect();
    others.sort_unstable();
    others.into_iter().map(|agent| Contact { agent: AgentId(agent), position: Point3::origin() }).collect()
}

fn all_pairs(agents: u32) -> Vec<(u32, u32)> {
    (0..agents).flat_map(|one| (one + 1..agents).map(move |other| (one, other))).collect()
}

fn extent(size: u32) -> Extent {
    Extent::new([size; 3], 1.0).unwrap()
}

#[test]
fn two_agents_exchange_at_once_and_then_every_period() {
    let mut team = Team::new(2, extent(10), 5);
    let pair = [(0, 1)];
    assert_eq!(team.trigger(0, &[], 0), Trigger { at: Tick(u64::MAX), events: Events::FIRST_CONTACT });
    team.maps[0].note_free(&[1, 2, 3]);
    team.maps[1].note_wall(&[7, 9]);
    assert_eq!(team.tick(7, &pair, BUDGET), [8, 7]);
    assert_eq!(team.trigger(0, &pair, 7), Trigger { at: Tick(10), events: Events::FIRST_CONTACT });
    assert_eq!(team.tick(8, &pair, BUDGET), [0, 0]);
    assert_eq!(team.states(0), team.states(1));
    team.maps[0].note_covered(Cell::new(2, 0, 0));
    assert_eq!(team.tick(9, &pair, BUDGET), [0, 0]);
    // Changes received from the peer are not sent back.
    assert_eq!(team.tick(10, &pair, BUDGET), [6, 0]);
    team.tick(11, &pair, BUDGET);
    assert_eq!(team.states(0), team.states(1));
    assert_eq!(team.maps[1].covered(), 1);
    // A missed turn is made up for.
    team.maps[1].note_free(&[100]);
    assert_eq!(team.tick(15, &[], BUDGET), [0, 0]);
    assert!(team.tick(17, &pair, BUDGET)[1] > 0);
    assert_eq!(team.trigger(1, &pair, 17).at, Tick(20));
    let totals = team.sharings[0].totals();
    assert_eq!((totals.messages_sent, totals.bytes_sent, totals.messages_taken, totals.bytes_taken), (2, 14, 1, 7));
}

#[test]
fn received_changes_are_forwarded_but_not_returned() {
    let mut team = Team::new(3, extent(10), 5);
    team.maps[0].note_free(&[1, 2, 3]);
    team.maps[1].note_free(&[20, 21]);
    team.maps[2].note_wall(&[40]);
    team.tick(1, &[(0, 1)], BUDGET);
    team.tick(2, &[], BUDGET);
    team.tick(3, &[(1, 2)], BUDGET);
    team.tick(4, &[], BUDGET);
    assert_eq!(team.states(1), team.states(2), "C knows what A saw");
    assert_eq!(team.sent_cells(1, 2), [1, 2, 3, 20, 21]);
    assert_eq!(team.sent_cells(2, 1), [40]);
    for now in 5..30 {
        team.tick(now, &[(0, 1), (1, 2)], BUDGET);
    }
    assert_eq!(team.sent_cells(1, 0), [20, 21, 40], "nothing is returned, nothing is sent twice");
    assert_eq!(team.sent_cells(1, 2), [1, 2, 3, 20, 21]);
    assert_eq!(team.states(0), team.states(2));
}

#[test]
fn corrections_reach_all_receivers_of_the_error() {
    let mut team = Team::new(4, extent(10), 5);
    let chain = [(0, 1), (1, 2), (2, 3)];
    team.maps[0].note_wall(&[7, 8]);
    (0..20).for_each(|now| drop(team.tick(now, &chain, BUDGET)));
    assert_eq!(team.states(3)[7..9], [CellState::Wall; 2], "forwarded twice");
    team.maps[2].note_free(&[7]);
    team.maps[3].note_wall(&[8]);
    (20..40).for_each(|now| drop(team.tick(now, &chain, BUDGET)));
    for agent in 1..4 {
        assert_eq!(team.states(agent)[7..9], [CellState::Free, CellState::Wall], "agent {agent}");
        assert_eq!((team.maps[agent].corrections(), team.maps[agent].contradictions()), (1, 0));
    }
    assert_eq!(team.states(0)[7], CellState::Wall, "it has seen it");
    assert_eq!((team.maps[0].corrections(), team.maps[0].contradictions()), (0, 1));
}

#[test]
fn content_received_by_all_is_not_forwarded() {
    let mut team = Team::new(4, extent(10), 5);
    let all = all_pairs(4);
    for (agent, map) in (0..).zip(&mut team.maps) {
        map.note_free(&[10 * agent, 10 * agent + 1]);
    }
    for now in 0..20 {
        let sent = team.tick(now, &all, BUDGET);
        assert_eq!(sent.iter().any(|&bytes| bytes > 0), now == 0, "tick {now}");
    }
    assert_eq!(team.delivered.len(), 4 * 3 * 2);
    assert!((1..4).all(|agent| team.states(agent) == team.states(0)));
}

#[test]
fn remainder_is_sent_in_the_next_ticks() {
    let size = 40;
    let mut team = Team::new(2, extent(size), 1000);
    let pair = [(0, 1)];
    let volume = size * size * size;
    // Isolated cells have the longest encoding.
    let scattered: Vec<u32> = (0..volume).filter(|cell| cell % 3 == 0).collect();
    team.maps[0].note_free(&scattered);
    let budget = 2500;
    let mut ticks = 0;
    loop {
        let sent = team.tick(ticks, &pair, budget)[0];
        let is_left_over = team.trigger(0, &pair, ticks).at == Tick(ticks + 1);
        assert!(sent > budget - 2 * BUDGET_MIN || !is_left_over, "{sent}");
        // Later changes have to wait for the next exchange.
        team.maps[0].note_free(&[1 + 3 * ticks as u32]);
        ticks += 1;
        if !is_left_over {
            break;
        }
    }
    assert!((4..8).contains(&ticks), "{ticks}");
    team.tick(ticks, &pair, budget);
    assert_eq!(team.sent_cells(0, 1).len(), scattered.len());
    assert_eq!(team.maps[1].free(), scattered.len());
}

#[test]
fn interrupted_exchange_continues_at_the_next_contact() {
    let mut team = Team::new(2, extent(40), 1000);
    team.maps[0].note_free(&(0..20_000).map(|cell| 3 * cell).collect::<Vec<_>>());
    team.tick(3, &[(0, 1)], 2000);
    assert_eq!(team.trigger(0, &[(0, 1)], 3).at, Tick(4));
    assert_eq!(team.trigger(0, &[], 3).at, Tick(u64::MAX));
    assert_eq!(team.tick(4, &[], BUDGET), [0, 0]);
    team.tick(90, &[(0, 1)], BUDGET);
    team.tick(91, &[], BUDGET);
    assert_eq!(team.sent_cells(0, 1).len(), 20_000);
    assert_eq!(team.maps[1].free(), 20_000);
}

#[test]
fn exchange_leaves_room_in_the_inbox_for_others() {
    let agents = 20;
    let mut team = Team::new(agents, extent(128), 251);
    team.maps[0].note_free(&(0..600_000).map(|cell| 3 * cell).collect::<Vec<_>>());
    let room = INBOX_BYTES / agents as usize;
    let mut sent = 0;
    for tick in 0..251 {
        sent += team.tick(tick, &[(0, 1)], BUDGET)[0];
    }
    assert!(sent > room / 3 && sent < room, "{sent} of {room}");
    for tick in 251..5000 {
        team.tick(tick, &[(0, 1)], BUDGET);
    }
    assert_eq!(team.maps[1].free(), 600_000);
}

#[test]
fn exchange_takes_few_bytes_per_cell() {
    const HALLS_X: [i32; 3] = [14, 24, 34];
    const RADIUS: f64 = 8.0;
    let mut team = Team::new(2, extent(50), 5);
    let distance =
        |cell: Cell, x: i32| f64::from((cell.x - x).pow(2) + (cell.y - 25).pow(2) + (cell.z - 25).pow(2)).sqrt();
    let is_free = |cell: Cell| HALLS_X.into_iter().any(|x| distance(cell, x) < RADIUS);
    let mut delivered = 0;
    // Three rooms that open into each other; for the second and third, only the part beyond the one
    // before is new.
    for (exchange, x) in (0..).zip(HALLS_X) {
        let map = &mut team.maps[0];
        let seen: Vec<Cell> = map.extent().cells().filter(|&cell| distance(cell, x) < RADIUS + 1.0).collect();
        let (free, wall): (Vec<Cell>, Vec<Cell>) = seen.into_iter().partition(|&cell| is_free(cell));
        let indices = |cells: &[Cell]| -> Vec<u32> {
            cells.iter().filter_map(|&cell| extent(50).index(cell)).map(|index| index as u32).collect()
        };
        map.note_free(&indices(&free));
        map.note_wall(&indices(&wall));
        let cells = map.journal_len() - delivered;
        delivered = map.journal_len();
        let bytes = team.tick(5 * exchange, &[(0, 1)], BUDGET)[0];
        let bytes_per_100_cells = 100 * bytes / cells;
        assert!((5..40).contains(&bytes_per_100_cells), "exchange {exchange}: {bytes} bytes for {cells} cells");
    }
    assert_eq!(team.delivered.len(), delivered);
    assert_eq!(team.maps[0].contradictions(), 0);
}

#[test]
fn period_0_only_receives() {
    let mut team = Team::new(2, extent(10), 5);
    team.sharings[1] = Sharing::new(AgentId(1), 0, 2);
    team.maps.iter_mut().zip([3, 500]).for_each(|(map, cell)| map.note_free(&[cell]));
    assert_eq!(team.trigger(1, &[(0, 1)], 0), Trigger { at: Tick(u64::MAX), events: 0 });
    assert!(team.tick(0, &[(0, 1)], BUDGET)[0] > 0);
    assert_eq!(team.tick(5, &[(0, 1)], BUDGET), [0, 0]);
    assert_eq!((team.maps[0].free(), team.maps[1].free()), (1, 2));
}

#[test]
fn malformed_messages_are_rejected_and_other_kinds_ignored() {
    let mut map = ExplorationMap::new(extent(4));
    let mut sharing = Sharing::new(AgentId(0), 5, 3);
    let message = |kind, data: &[u8]| ReceivedMessage { from: AgentId(2), kind, data: data.into() };
    let received = [
        message(MAP_MESSAGE, &[9]),
        message(0, &[1, 2, 3]),
        message(MAP_MESSAGE, &[VERSION, 1, 0, 1, 0b100_1000, 0]),
        message(MAP_MESSAGE, &[VERSION, 1, 0, 1, 1, 0]),
    ];
    let report = sharing.incoming(&mut map, &received);
    let refused = [(AgentId(2), MapMessageError::Version(9)), (AgentId(2), MapMessageError::Outside { block: 1 })];
    assert_eq!(report, Report { messages: 1, for_others: 0, news: 1, refused: refused.to_vec() });
    let totals = *sharing.totals();
    assert_eq!((totals.messages_refused, totals.messages_taken), (2, 1));
    // Every byte of map messages is counted as merged or rejected; messages of other kinds are not
    // counted.
    let bytes: usize =
        received.iter().filter(|message| message.kind == MAP_MESSAGE).map(|message| message.data.len()).sum();
    assert_eq!(totals.bytes_refused + totals.bytes_taken, bytes as u64);
    assert_eq!((map.free(), map.state(Cell::new(3, 0, 0))), (1, CellState::Free));
}

/// The most that one false message can report: the whole map is free, or all of it wall.
fn whole_map(extent: Extent, finding: Finding) -> ReceivedMessage {
    let all = (0..extent.volume() as u32).map(|cell| Change { cell, finding, from: None });
    ReceivedMessage {
        from: AgentId(2),
        kind: MAP_MESSAGE,
        data: map_message::encode(&[AgentId(0), AgentId(3)], &Delta::of(extent, all)).into(),
    }
}

#[test]
fn message_for_others_is_ignored() {
    let extent = extent(4);
    let mut map = ExplorationMap::new(extent);
    let mut sharing = Sharing::new(AgentId(1), 5, 4);
    let report = sharing.incoming(&mut map, &[whole_map(extent, Finding::Free)]);
    assert_eq!(report, Report { for_others: 1, ..Report::default() });
    assert_eq!((map.free(), *sharing.totals()), (0, Totals::default()));
}

/// Copies for all who lack the news would not fit into a command: nothing was ever sent.
#[test]
fn news_for_most_of_a_crowd_is_broadcast() {
    let agents = 200;
    let mut team = Team::new(agents, extent(6), 50);
    let pairs = all_pairs(agents);
    (0..2).for_each(|now| drop(team.tick(now, &pairs, BUDGET)));
    // Agent 1 knows from agent 0 what all others lack.
    team.maps[0].note_free(&[7]);
    (50..52).for_each(|now| drop(team.tick(now, &[(0, 1)], BUDGET)));
    let to_others: Vec<(u32, u32)> = (0..agents).filter(|&other| other != 1).map(|other| (1, other)).collect();
    (100..102).for_each(|now| drop(team.tick(now, &to_others, BUDGET)));
    assert!(team.maps.iter().all(|map| map.free() == 1));
    assert_eq!(team.sharings[1].totals().messages_sent, 1);
    assert_eq!(team.trigger(1, &to_others, 101).at, Tick(150));
}

#[test]
fn flooding_sender_is_barred() {
    let extent = extent(12);
    let volume = extent.volume() as u64;
    let mut map = ExplorationMap::new(extent);
    let mut sharing = Sharing::new(AgentId(0), 5, 4);
    let lies = [whole_map(extent, Finding::Wall), whole_map(extent, Finding::Free)];
    let mut taken = Vec::new();
    for _ in 0..50 {
        let flood: Vec<ReceivedMessage> = lies.iter().cycle().take(64).cloned().collect();
        taken.push(sharing.incoming(&mut map, &flood).messages);
    }
    assert_eq!((taken[0], taken.iter().sum()), (CHANGES_MAX, CHANGES_MAX));
    let totals = *sharing.totals();
    assert_eq!((totals.cells_taken, totals.messages_refused), (CHANGES_MAX as u64 * volume, 50 * 64 - 4));
    assert!(map.journal_len() as u64 <= CHANGES_MAX as u64 * volume);
    // Malformed messages get the same answer, since messages of barred senders are not decoded.
    let refused = |sharing: &mut Sharing, map: &mut ExplorationMap, from: u32, data: &[u8]| {
        let message = ReceivedMessage { from: AgentId(from), kind: MAP_MESSAGE, data: data.into() };
        sharing.incoming(map, &[message]).refused
    };
    let barred = MapMessageError::Barred { allowance: 4 * volume };
    assert_eq!(refused(&mut sharing, &mut map, 2, &[9]), [(AgentId(2), barred)]);
    // Other senders are not affected, and the own sensor still overrides.
    assert_eq!(refused(&mut sharing, &mut map, 1, &lies[0].data), []);
    map.note_wall(&[5]);
    assert_eq!(map.state(Cell::new(5, 0, 0)), CellState::Wall);
}

#[test]
fn full_first_exchange_of_all_is_accepted() {
    let agents = 6;
    let extent = extent(30);
    let mut team = Team::new(agents, extent, 50);
    let volume = extent.volume() as u32;
    // Each has seen all of the map and visited half of it: the most that an agent can have to send.
    for (id, map) in (0..).zip(&mut team.maps) {
        map.note_free(&(0..volume).collect::<Vec<_>>());
        (0..volume).filter(|cell| cell % 2 == id % 2).for_each(|cell| map.note_covered(extent.cell_at(cell as usize)));
    }
    (0..250).for_each(|now| drop(team.tick(now, &all_pairs(agents), 3000)));
    for agent in 0..agents as usize {
        assert_eq!(team.maps[agent].covered(), volume as usize);
        assert_eq!(team.sharings[agent].totals().messages_refused, 0);
    }
}

proptest! {
    #[test]
    fn random_bytes_are_merged_or_rejected(
        mut datas in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..60), 0..8),
    ) {
        let mut map = ExplorationMap::new(extent(5));
        let mut sharing = Sharing::new(AgentId(0), 5, 3);
        let mut count = 0;
        for (at, data) in datas.iter_mut().enumerate() {
            if at % 2 == 0 && data.len() > 1 {
                data[0] = VERSION;
                data[1] %= 3;
            }
            let message = ReceivedMessage { from: AgentId(1), kind: MAP_MESSAGE, data: data.clone().into() };
            let report = sharing.incoming(&mut map, &[message]);
            count += report.messages + report.for_others + report.refused.len();
        }
        prop_assert_eq!(count, datas.len());
        prop_assert!(map.changes_since(0).all(|change| change.cell < 125));
        let contact = Contact { agent: AgentId(2), position: Point3::origin() };
        sharing.outgoing(&map, &[contact], Tick(1), BUDGET);
    }

    #[test]
    fn maps_converge_to_own_findings_and_best_reports(
        findings in prop::collection::vec((0usize..4, 0u32..27, 0u8..3), 0..80),
        meetings in prop::collection::vec((0u32..4, 0u32..4), 1..20),
        pace in 1usize..20,
    ) {
        let agents = 4;
        let mut team = Team::new(agents, extent(3), 3);
        // What each has found, in ascending precedence: nothing, wall, free, covered.
        let mut own = vec![[0u8; 27]; agents as usize];
        let mut now = 0;
        for (at, (agent, cell, what)) in findings.into_iter().enumerate() {
            let map = &mut team.maps[agent];
            match what {
                0 => map.note_wall(&[cell]),
                1 => map.note_free(&[cell]),
                _ => map.note_covered(map.extent().cell_at(cell as usize)),
            }
            let found = &mut own[agent][cell as usize];
            *found = if *found == 0 || *found > 1 && what > 0 { (what + 1).max(*found) } else { *found };
            if at % pace == 0 {
                now += 1;
                let (one, other) = meetings[at / pace % meetings.len()];
                let pair = (one != other).then_some((one, other));
                team.tick(now, pair.as_slice(), BUDGET);
            }
        }
        for _ in 0..8 {
            now += 1;
            team.tick(now, &all_pairs(agents), BUDGET);
        }
        for agent in 0..agents as usize {
            for cell in 0..27 {
                let heard = own.iter().map(|found| found[cell]).max().unwrap();
                let believed = match own[agent][cell] {
                    0 => heard,
                    2 if heard == 3 => 3,
                    found => found,
                };
                let state =
                    [CellState::Unexplored, CellState::Wall, CellState::Free, CellState::Covered][believed as usize];
                prop_assert_eq!(team.states(agent)[cell], state, "agent {}, cell {}", agent, cell);
            }
        }
    }

    #[test]
    fn knowledge_propagates_along_a_chain(
        findings in prop::collection::vec((0u32..5, 0u32..1000, any::<bool>()), 0..60),
    ) {
        let agents = 5;
        let mut team = Team::new(agents, extent(10), 2);
        let chain: Vec<(u32, u32)> = (1..agents).map(|agent| (agent - 1, agent)).collect();
        for (agent, cell, is_visit) in findings {
            let map = &mut team.maps[agent as usize];
            if is_visit {
                map.note_covered(map.extent().cell_at(cell as usize));
            } else {
                map.note_free(&[cell]);
            }
        }
        (0..12).for_each(|now| drop(team.tick(now, &chain, BUDGET)));
        for agent in 1..agents as usize {
            prop_assert_eq!(team.states(agent), team.states(0), "no mark of coverage is lost");
        }
        let count = team.delivered.len();
        team.delivered.sort_unstable();
        team.delivered.dedup();
        prop_assert_eq!(team.delivered.len(), count, "nothing is sent twice");
    }

    #[test]
    fn maps_converge_after_all_pairs_exchange(
        agents in 2u32..6,
        findings in prop::collection::vec((0u32..6, 0u32..1000, any::<bool>()), 0..150),
        meetings in prop::collection::vec((0u32..6, 0u32..6), 0..25),
        budget in 1100usize..4000,
    ) {
        let mut team = Team::new(agents, extent(10), 4);
        let mut meetings = meetings.into_iter();
        let mut now = 0;
        for (at, (agent, cell, is_visit)) in findings.into_iter().enumerate() {
            let map = &mut team.maps[(agent % agents) as usize];
            match cell % 3 {
                0 => map.note_wall(&[cell]),
                _ if is_visit => map.note_covered(map.extent().cell_at(cell as usize)),
                _ => map.note_free(&[cell]),
            }
            if at % 6 == 0 {
                now += 1;
                let pair = meetings.next().map(|(one, other)| (one % agents, other % agents));
                let pair = pair.filter(|(one, other)| one != other);
                team.tick(now, pair.as_slice(), budget);
            }
        }
        let all = all_pairs(agents);
        for _ in 0..16 {
            now += 1;
            team.tick(now, &all, budget);
        }
        for agent in 1..agents as usize {
            prop_assert_eq!(team.states(agent), team.states(0));
            prop_assert_eq!(team.maps[agent].contradictions(), 0);
        }
        let count = team.delivered.len();
        team.delivered.sort_unstable();
        team.delivered.dedup();
        prop_assert_eq!(team.delivered.len(), count, "nothing is sent twice");
    }
}

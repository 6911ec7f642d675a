//! Time that signatures take: signs and checks every observation and command of a recording, as
//! server and agents do.
//!
//! ```text
//! cargo run --release -p tests --example signing_cost -- run.mcap
//! ```

use std::hint::black_box;
use std::path::PathBuf;

use msgs::maes_msgs::{Command, Observation};
use protocol::signed::Signed;
use protocol::signing::SessionKey;
use recording::Recording;
use system::wall_clock::now;

#[expect(clippy::print_stdout, reason = "this is what the program is for")]
fn main() {
    let file: PathBuf = std::env::args_os().nth(1).expect("usage: signing_cost FILE.mcap").into();
    let recording = Recording::open(&file).unwrap_or_else(|error| panic!("{error}"));
    let (mut observations, mut commands): (Vec<Observation>, Vec<Command>) = Default::default();
    let mut bytes = 0;
    for message in recording.messages() {
        match message.of_agent() {
            Some((_, "observation")) => observations.push(message.decode().expect("an observation")),
            Some((_, "command")) => commands.push(message.decode().expect("a command")),
            _ => continue,
        }
        bytes += message.data.len();
    }
    let key = SessionKey::new([7; 32]);
    let count = observations.len() + commands.len();
    let begun = now();
    for observation in observations {
        black_box(Signed::sign(black_box(observation), &key).verify(&key).is_ok());
    }
    for command in commands {
        black_box(Signed::sign(black_box(command), &key).verify(&key).is_ok());
    }
    let ms = begun.elapsed().as_secs_f64() * 1e3;
    println!("{count} messages, {bytes} bytes: signed and checked in {ms:.1} ms of one core");
}

//! Batches of runs: plans, their execution and the metrics of each run.
//!
//! In reading order:
//! - A batch: a [`plan`] lists runs, [`execute`] performs those without a record, [`measure`] turns
//!   each into [`rows`], [`store`] keeps these in a folder, [`keep`] decides which recordings stay,
//!   and [`tables`] writes CSV and Parquet,
//!   with the [`columns`] that the rows declare. [`merge`] joins folders, [`cluster`] writes job files
//!   for clusters.
//! - What is possible: [`oracle`] bounds the times of all runs from below, and flies a plan with
//!   the map known in advance.
//! - A [`benchmark`] is fixed plans with one number for each track, whose results can be verified.
//! - Comparison of recordings: [`diff`] finds the first difference of two.
//!
//! Invariant: except for wall time, the record of a run is a function of scenario, seed and build.
//!
//! The library prints nothing and parses no command line: `maes` does both.

pub mod benchmark;
pub mod cluster;
pub mod columns;
pub mod diff;
pub mod execute;
pub mod keep;
pub mod measure;
pub mod merge;
pub mod oracle;
pub mod plan;
pub mod rows;
pub mod store;
pub mod tables;

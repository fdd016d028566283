//! The response of the sliding cloth, some times over: what a profiler counts instructions of.
//!
//! `incline -- [coulomb | coulomb-stiction | stribeck | viscous] [times]`

#![allow(clippy::print_stdout, reason = "the output of an example")]

use cloth_benches::incline::{Incline, law};
use cloth_response::FrictionRule;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "coulomb".into());
    let times: usize = std::env::args().nth(2).map_or(Ok(10), |n| n.parse())?;
    let law = law(&name).ok_or_else(|| format!("no law is called {name:?}"))?;
    let mut scene = Incline::new(FrictionRule::uniform(law), 1)?;
    for _ in 0..times {
        let info = scene.respond()?;
        println!("{info:?}");
    }
    Ok(())
}

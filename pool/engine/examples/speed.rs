//! Development tool; see benches.
#[path = "../../../benches/src/engine/play.rs"]
mod play;
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let policy = &a[0];
    let names: Vec<String> = if a.len() > 2 {
        a[2..].to_vec()
    } else {
        smaclite_scenarios::Scenario::standard_names().map(str::to_owned).collect()
    };
    let mut log = 0.0;
    if a[1] == "once" {
        let mut play = play::Play::record(&names[0], policy, 100).unwrap();
        play.play_measured();
        println!("unit_ticks {}", play.unit_ticks);
        return;
    }
    if a[1] == "hash" {
        for name in &names {
            let steps = 1500;
            let mut play = play::Play::record(name, policy, steps).unwrap();
            println!("{name:16} {:016x}", play.hash());
        }
        return;
    }
    let seconds: f64 = a[1].parse().unwrap();
    for name in &names {
        let mut play = play::Play::record(name, policy, 200).unwrap();
        let begin = Instant::now();
        let mut shortest = vec![u64::MAX; play.steps()];
        while begin.elapsed().as_secs_f64() < seconds {
            play.play_timed(&mut shortest);
        }
        let best = shortest.iter().sum::<u64>() as f64;
        let ns = best / play.unit_ticks as f64;
        log += ns.ln();
        println!("{name:16} {ns:8.1} {:10.0} steps/s", play.steps() as f64 / best * 1e9);
    }
    println!("geometric mean   {:8.1}", (log / names.len() as f64).exp());
}

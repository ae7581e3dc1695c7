//! Records the attack-nearest policy on a standard scenario and writes `NAME.smreplay` and `NAME.html`.
//!
//! `cargo run --release -p smaclite-view --example export -- FOLDER NAME [EPISODES] [SEED] [random]`

use smaclite_engine::{Rules, policy};
use smaclite_scenarios::ScenarioFiles;
use smaclite_view::{Recorder, Setup, export_html};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, name, rest @ ..] = arguments.as_slice() else {
        return Err("expected FOLDER NAME [EPISODES] [SEED] [random]".into());
    };
    let number = |i: usize, default: u64| rest.get(i).map_or(Ok(default), |text| text.parse());
    let (episodes, seed) = (number(0, 1)?, number(1, 1)?);
    let (scenario, files) = ScenarioFiles::resolve(name)?;
    let setup = Setup { files, rules: Rules::Smaclite, episode_limit: scenario.episode_limit };
    let mut recorder = Recorder::new(setup, seed)?;
    let mut random = policy::Random::new(seed);
    let mut actions = vec![0; scenario.n_agents()];
    for episode in 0..episodes {
        if episode > 0 {
            recorder.reset()?;
        }
        while !recorder.battle().is_over() {
            match rest.get(2) {
                Some(_) => random.act(recorder.battle(), &mut actions),
                None => policy::nearest(recorder.battle(), &mut actions),
            }
            recorder.step(&actions)?;
        }
    }
    let replay = recorder.finish();
    let path = std::path::Path::new(folder).join(format!("{}.smreplay", scenario.name));
    replay.write(&path)?;
    let page = export_html(&replay)?;
    println!("{name}: replay {} bytes, page {} bytes", std::fs::metadata(&path)?.len(), page.len());
    std::fs::write(path.with_extension("html"), page)?;
    Ok(())
}

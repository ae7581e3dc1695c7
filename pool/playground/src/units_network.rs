//! The forward pass of an actor over units, in plain loops; `smaclite-learn`'s `units_network.rs` derives it.

use crate::layer::{Activation, Layer, WeightsError};
use safetensors::SafeTensors;
use smaclite_engine::{RowMap, TargetLayout, UnitLayout, UnitRows, UniversalRows};

/// An actor that has the same maps for all enemies, and for all allies.
#[derive(Debug)]
pub(crate) struct UnitsNetwork {
    layout: UnitLayout,
    targets: TargetLayout,
    activation: Activation,
    own: Layer,
    enemies: Option<Kind>,
    allies: Option<Kind>,
    trunk: [Layer; 2],
    head: Layer,
}

/// The maps of the units of a kind.
#[derive(Debug)]
struct Kind {
    layers: [Layer; 2],
    /// `None` if no action targets such units.
    target: Option<Target>,
}

#[derive(Debug)]
struct Target {
    unit: Layer,
    trunk: Layer,
    score: Layer,
}

impl UnitsNetwork {
    /// The actor in a file of weights, with these widths of embeddings and trunk. `rows` are how those of the
    /// scenario become rows of a universal network.
    pub fn read(
        arrays: &SafeTensors<'_>,
        layout: UnitLayout,
        targets: TargetLayout,
        [width, trunk_width]: [usize; 2],
        activation: Activation,
        rows: Option<&UniversalRows>,
    ) -> Result<UnitsNetwork, WeightsError> {
        let layer = |name: &str, n_in, n_out| Layer::read(arrays, name, n_in, n_out);
        let of_rows = |name: &str, n_in, map: Option<&RowMap>| match map {
            None => layer(name, n_in, width),
            Some(map) => Ok(layer(name, map.widths()[0], width)?.on(map)),
        };
        let target = |name: &str| -> Result<Target, WeightsError> {
            Ok(Target {
                unit: Layer::without_bias(arrays, &format!("{name}.target.unit"), width, width)?,
                trunk: layer(&format!("{name}.target.trunk"), trunk_width, width)?,
                score: layer(&format!("{name}.target.score"), width, 1)?,
            })
        };
        let kind =
            |name: &str, units: &UnitRows, map, is_target: bool| -> Result<Option<Kind>, WeightsError> {
                if units.count == 0 {
                    return Ok(None);
                }
                let first = of_rows(&format!("{name}.0"), units.width(), map)?;
                let layers = [first, layer(&format!("{name}.1"), width, width)?];
                Ok(Some(Kind { layers, target: if is_target { Some(target(name)?) } else { None } }))
            };
        let enemies = kind("enemies", &layout.enemies, rows.map(|rows| &rows.enemies), true)?;
        let allies = kind("allies", &layout.allies, rows.map(|rows| &rows.allies), targets.has_healers())?;
        let pooled = |n_kinds: usize| width * (1 + 2 * n_kinds);
        let n_pooled = pooled(enemies.iter().chain(&allies).count());
        let first = match rows {
            None => layer("trunk.0", n_pooled, trunk_width)?,
            // Allies are pooled last, and an agent may have none.
            Some(_) => layer("trunk.0", pooled(2), trunk_width)?.on(&RowMap::prefix(n_pooled, pooled(2))),
        };
        Ok(UnitsNetwork {
            own: of_rows("own", layout.rest_width(), rows.map(|rows| &rows.rest))?,
            trunk: [first, layer("trunk.1", trunk_width, trunk_width)?],
            head: layer("head", trunk_width, targets.first)?,
            layout,
            targets,
            activation,
            enemies,
            allies,
        })
    }

    /// The outputs for what an agent observes.
    pub fn forward(&self, agent: usize, obs: &[f32]) -> Vec<f32> {
        let rest: Vec<f32> =
            self.layout.rest.iter().flat_map(|columns| &obs[columns.clone()]).copied().collect();
        let own = self.own.forward(&rest);
        let mut pooled = self.activated(own.clone());
        let enemies = self.embeddings(&self.enemies, &self.layout.enemies, obs, &own, &mut pooled);
        let allies = self.embeddings(&self.allies, &self.layout.allies, obs, &own, &mut pooled);
        let trunk = self.activated(self.trunk[0].forward(&pooled));
        let trunk = self.activated(self.trunk[1].forward(&trunk));
        let heals = self.targets.heals(agent, obs);
        let (kind, embeddings) = if heals { (&self.allies, allies) } else { (&self.enemies, enemies) };
        let mut outputs = self.head.forward(&trunk);
        for number in 0..self.targets.count {
            let row = if heals { TargetLayout::ally_row(agent, number) } else { Some(number) };
            let embedding = row.and_then(|row| embeddings.get(row)?.as_deref());
            let target = kind.as_ref().and_then(|kind| kind.target.as_ref());
            outputs.push(target.map_or(0.0, |target| self.score(target, embedding, &trunk)));
        }
        outputs
    }

    /// The number of the action that targets a unit, which may not be seen.
    fn score(&self, target: &Target, embedding: Option<&[f32]>, trunk: &[f32]) -> f32 {
        let mut hidden = target.trunk.forward(trunk);
        if let Some(embedding) = embedding {
            add(&mut hidden, &target.unit.forward(embedding));
        }
        target.score.forward(&self.activated(hidden))[0]
    }

    /// The embeddings of the units of a kind, `None` of those that are not seen. Appends their sum and their
    /// maximum to `pooled`.
    fn embeddings(
        &self,
        kind: &Option<Kind>,
        rows: &UnitRows,
        obs: &[f32],
        own: &[f32],
        pooled: &mut Vec<f32>,
    ) -> Vec<Option<Vec<f32>>> {
        let Some(Kind { layers, .. }) = kind else { return Vec::new() };
        let embedding = |unit: usize| {
            rows.is_seen(obs, unit).then(|| {
                let row: Vec<f32> = rows.row(obs, unit).flatten().copied().collect();
                let mut first = layers[0].forward(&row);
                add(&mut first, own);
                self.activated(layers[1].forward(&self.activated(first)))
            })
        };
        let embeddings: Vec<Option<Vec<f32>>> = (0..rows.count).map(embedding).collect();
        let seen = || embeddings.iter().flatten();
        let mut sum = vec![0.0; own.len()];
        seen().for_each(|embedding| add(&mut sum, embedding));
        pooled.extend(sum);
        let max = |j: usize| seen().map(|embedding| embedding[j]).reduce(f32::max).unwrap_or(0.0);
        pooled.extend((0..own.len()).map(max));
        embeddings
    }

    fn activated(&self, mut z: Vec<f32>) -> Vec<f32> {
        z.iter_mut().for_each(|z| *z = self.activation.of(*z));
        z
    }
}

fn add(to: &mut [f32], values: &[f32]) {
    to.iter_mut().zip(values).for_each(|(to, value)| *to += value);
}

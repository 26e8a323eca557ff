//! Tables of set-ups with every parameter and what follows from them, for the dry run.

use comfy_table::Table;

use super::table;
use crate::campaign::{Campaign, CampaignSetUp};
use crate::report::parameters::rows;

/// Set-ups side by side in one table.
const SIDE_BY_SIDE: usize = 6;

/// Every parameter of every set-up, a column each; several tables if there are many.
pub fn parameters(campaign: &Campaign) -> Vec<Table> {
    campaign.set_ups.chunks(SIDE_BY_SIDE).map(side_by_side).collect()
}

fn side_by_side(set_ups: &[CampaignSetUp]) -> Table {
    let header: Vec<&str> = std::iter::once("parameter").chain(set_ups.iter().map(|s| s.name.as_str())).collect();
    let mut table = table(&header);
    for row in rows(set_ups) {
        let cells = row.values.into_iter().map(|value| value.unwrap_or_else(|| "–".into()));
        table.add_row(std::iter::once(row.name.to_string()).chain(cells));
    }
    table
}

//! Whole cells on virtual time, and what documents say of them.
//!
//! - `added_node`: a node that no list of the workspace knows joins a cell
//! - `adopted`: a hidden error is found, adopted, and absent from the next gap
//! - `again`: an interrupted scan is resumed, and points are measured again
//! - `approvals`: an approval is a signature over the exact correction, session and instant
//! - `bad_input`: cell files and messages as they should not be: a clear sentence or a fault
//! - `corrections`: no correction reaches the machine without bound, source, approval and session
//! - `dev_bags`: recordings of other cells: deviations against NumPy, plans ordered again
//! - `driver_guide`: the driver guide says of messages what the interface package says
//! - `faults`: what goes wrong at the machine ends in a named fault and a stopped part
//! - `further`: further touches of a part in its clamping, where the first plan is ambiguous
//! - `gap`: the node `gap` gives the answer of the command line
//! - `guarantees`: each promise of `docs/guarantees.md` names what shows it
//! - `memory`: what nodes keep is bounded over a million messages
//! - `poses`: a part that may be touched at several poses
//! - `reference`: the turn-mill with its CMM, diagnosed from recordings
//! - `replay`: a session made again from its recording, its snapshots and a bag on disk
//! - `restarts`: a process that ends while a part is made is started again
//! - `robot`: robotic cells, and what the diagnosis says of planted errors of an arm
//! - `samples`: the sample recordings are what their recipes make and promise
//! - `scenario_cells`: the cells of `docs/source_systems.md, B to E`, whole
//! - `scenario_sessions`: the gaps of the source systems through whole cells
//! - `state`: nothing in the memory of a node is for nothing, or lost unseen
//! - `supervision`: processes that end or fall silent: the machine stops, and every part ends in a report
//! - `support`: what several of them begin with
//! - `tidy`: what documents claim and nobody would notice to be false
//! - `turn_mill`: the turn-mill against the source's tables
//! - `viewers`: frames and markers that a viewer gets
//! - `volumetric`: a machine finds, proposes and writes its own volumetric table
//! - `work_offset`: a part that lies off its place: the work offsets follow it

mod added_node;
mod adopted;
mod again;
mod approvals;
mod bad_input;
mod corrections;
mod dev_bags;
mod driver_guide;
mod faults;
mod further;
mod gap;
mod guarantees;
mod memory;
mod poses;
mod reference;
mod replay;
mod restarts;
mod robot;
mod samples;
mod scenario_cells;
mod scenario_sessions;
mod state;
mod supervision;
mod support;
mod tidy;
mod turn_mill;
mod viewers;
mod volumetric;
mod work_offset;

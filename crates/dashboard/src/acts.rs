//! Acts of operators from a page: approve, reject, stop, make a part, change the orders, touch again, take the proposed touches.
//!
//! The key is the operator's, on the operator's device (`assets/acts.js`). The page asks for an [`Offer`]: what exactly is to
//! be signed ([`signatures::Act`]). It shows it, signs it together with what it has shown, and sends the signature. The dashboard has
//! no operator's key and cannot act by itself: it hands the signed act to the service of the cell that the commands `approve`,
//! `stop`, `orders` and `run` call. An answer to a correction is verified by the cell, which records refusals as well; for the
//! others, which the cell takes without a signature too, the signature is verified here.
//!
//! A cell takes acts only where the dashboard was given its file, which says how to reach its services and which key it has.

mod forward;
mod offer;
mod stops;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use host::bus::BusConfig;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::srv::ManageOrdersRequest;
use probecell_msgs::{InspectionPoint, OperatorKeys, from_cdr};
use serde::{Deserialize, Serialize};
use signatures::approval::{NotApproved, check};
use signatures::{Act, Kind, PublicKey, operators};
use tokio::sync::Semaphore;

use self::stops::Stops;
use crate::state::Hall;

/// How long an offer counts: as long as an approval counts after it was signed.
const OFFERED: Duration = Duration::from_secs(60);
/// Offers at once.
const OFFERS: usize = 64;
/// Acts at once, other than stops.
const AT_ONCE: usize = 4;
/// Bytes of what was shown.
const SHOWN: usize = 4096;
/// Bytes of a token.
const TOKEN: usize = 16;

/// A cell that takes acts.
pub struct ActionEndpoint {
    /// Its name.
    pub cell: String,
    /// Its public key.
    pub key: PublicKey,
    /// Where it answers its own user past the bus ([`host::private`]).
    pub private: Option<PathBuf>,
    /// How its services are reached now; the error is a sentence. May block for a moment.
    pub bus: Way,
}

/// Says how services are reached.
pub type Way = Box<dyn Fn() -> Result<BusConfig, String> + Send + Sync>;

/// What somebody is about to do.
enum Deed {
    /// Approve or reject a correction.
    Answer { correction: String, approve: bool },
    /// Stop the machine.
    Stop,
    /// Make a part.
    Make { part: String },
    /// Change the orders.
    Order(ManageOrdersRequest),
    /// Touch points of the part in the machine.
    Touch {
        part: String,
        plan: String,
        points: Vec<InspectionPoint>,
    },
}

impl Deed {
    fn kind(&self) -> Kind {
        match self {
            Self::Answer { approve: true, .. } => Kind::Approve,
            Self::Answer { approve: false, .. } => Kind::Reject,
            Self::Stop => Kind::Stop,
            Self::Make { .. } | Self::Order(_) | Self::Touch { .. } => Kind::Run,
        }
    }
}

/// An act as it was offered to a page.
struct Offer {
    cell: String,
    deed: Deed,
    at: Time,
    subject: Vec<u8>,
    made: Instant,
}

/// What a page asks for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wish {
    cell: String,
    /// `approve`, `reject`, `stop`, `make`, `cancel`, `first`, `release`, `again` or `next`.
    act: String,
    /// Correction, part, order, feature or number of the proposal.
    #[serde(default)]
    subject: String,
}

/// What a page signs.
#[derive(Serialize)]
pub(crate) struct Offered {
    token: String,
    cell_key: String,
    kind: &'static str,
    /// ns since 1970, as text: a number of JSON would be rounded.
    at_ns: String,
    subject: String,
    /// What is to be shown, a line each.
    summary: Vec<String>,
}

/// An act that was signed.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Signed {
    token: String,
    pub(crate) operator: String,
    shown: String,
    /// Hexadecimal digits.
    signature: String,
}

/// The answer of the cell.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Answer {
    pub(crate) accepted: bool,
    pub(crate) text: String,
}

/// Offers of acts, and the cells that take them.
pub(crate) struct Acts {
    desks: BTreeMap<String, (ActionEndpoint, Mutex<Option<OperatorKeys>>)>,
    offers: Mutex<BTreeMap<String, Offer>>,
    stops: Stops,
    /// Of the pages of this process: no page from elsewhere can read it.
    pub(crate) page_token: String,
    running: Arc<Semaphore>,
}

impl Acts {
    pub(crate) fn new(desks: Vec<ActionEndpoint>) -> Result<Self, getrandom::Error> {
        let desks = desks.into_iter();
        Ok(Self {
            desks: desks
                .map(|desk| (desk.cell.clone(), (desk, Mutex::default())))
                .collect(),
            offers: Mutex::default(),
            stops: Stops::new()?,
            page_token: random()?,
            running: Arc::new(Semaphore::new(AT_ONCE)),
        })
    }

    /// Names of the cells that take acts.
    pub(crate) fn cells(&self) -> BTreeSet<String> {
        self.desks.keys().cloned().collect()
    }

    /// Takes the operators' keys that a cell has published: the newest that its key has signed.
    pub(crate) fn take_keys(&self, cell: &str, bytes: &[u8]) {
        if let (Some((desk, known)), Ok(keys)) = (self.desks.get(cell), from_cdr(bytes)) {
            operators::take(Some(&desk.key), &mut lock(known), keys);
        }
    }

    /// Offers an act; the error is a sentence for whoever asked. Blocks until the cell has given the time.
    pub(crate) fn offer(
        &self,
        hall: impl Deref<Target = Hall>,
        wish: &Wish,
    ) -> Result<Offered, String> {
        let (desk, _) = (self.desks.get(&wish.cell)).ok_or_else(|| no_desk(&wish.cell))?;
        let proposal = {
            let hall = hall;
            let cell = hall
                .cell(&wish.cell)
                .filter(|cell| !cell.is_stale(host::now()));
            let cell = cell.ok_or_else(|| format!("{} is silent", wish.cell))?;
            offer::propose(cell, desk.key, &wish.act, &wish.subject)?
        };
        let at = match proposal.deed {
            // Nothing is asked before a machine is stopped.
            Deed::Stop => host::now().time(),
            _ => forward::clock_of(desk)?,
        };
        let token = match proposal.deed {
            Deed::Stop => self.stops.token(desk, at),
            _ => random().map_err(|error| format!("the system has no random numbers: {error}"))?,
        };
        let offered = Offered {
            token: token.clone(),
            cell_key: desk.key.to_string(),
            kind: proposal.deed.kind().word(),
            at_ns: at.nanos().to_string(),
            subject: hexadecimal(&proposal.subject),
            summary: proposal.summary,
        };
        if matches!(proposal.deed, Deed::Stop) {
            return Ok(offered);
        }
        let mut offers = lock(&self.offers);
        offers.retain(|_, one| one.made.elapsed() < OFFERED);
        if offers.len() >= OFFERS {
            return Err("too many acts are waiting to be signed".to_owned());
        }
        let offer = Offer {
            cell: wish.cell.clone(),
            deed: proposal.deed,
            at,
            subject: proposal.subject,
            made: Instant::now(),
        };
        offers.insert(token, offer);
        Ok(offered)
    }

    /// Carries out a signed act: the answer of the cell, or a sentence that says why it was not even asked. Blocks.
    pub(crate) fn carry_out(&self, signed: &Signed) -> Result<Answer, String> {
        let not_offered = || {
            format!(
                "this act was not offered, was sent already, or was offered more than {} s ago",
                OFFERED.as_secs()
            )
        };
        let offer = self.offered(&signed.token).ok_or_else(not_offered)?;
        let (desk, keys) = (self.desks.get(&offer.cell)).ok_or_else(|| no_desk(&offer.cell))?;
        let by = &signed.operator;
        if by.is_empty() {
            return Err("an act needs the name of the operator".to_owned());
        }
        if signed.shown.is_empty() || signed.shown.len() > SHOWN {
            return Err(format!(
                "an act says in 1 to {SHOWN} bytes what was on the screen"
            ));
        }
        let signature = bytes(&signed.signature)
            .filter(|bytes| bytes.len() == 64)
            .ok_or_else(|| format!("the act of {by} is not signed"))?;
        if !matches!(offer.deed, Deed::Answer { .. }) {
            let act = Act {
                cell: desk.key,
                kind: offer.deed.kind(),
                by,
                at: offer.at,
                shown: &signed.shown,
                subject: offer.subject.clone(),
            };
            let keys = lock(keys).clone();
            let keys = keys.ok_or_else(|| NotApproved::NoKeys.to_string())?;
            check(&keys, &act, &signature).map_err(|why| match why {
                NotApproved::Forged(by) => format!("the signature of {by} is not of this act"),
                why => why.to_string(),
            })?;
        }
        if matches!(offer.deed, Deed::Stop) && !self.stops.take(&signed.token) {
            return Err(not_offered());
        }
        // A stop waits for nothing.
        let _turn = match offer.deed {
            Deed::Stop => None,
            _ => Some(
                Arc::clone(&self.running)
                    .try_acquire_owned()
                    .map_err(|_| "too many acts are under way".to_owned())?,
            ),
        };
        forward::forward(desk, &offer.deed, offer.at, signed, signature)
    }
}

impl Acts {
    /// What was offered under a token; an act other than a stop is no longer.
    fn offered(&self, token: &str) -> Option<Offer> {
        let desk = |cell: &str| self.desks.get(cell).map(|(desk, _)| desk);
        if let Some((desk, at)) = self.stops.offered(token, desk) {
            return Some(Offer {
                cell: desk.cell.clone(),
                deed: Deed::Stop,
                at,
                subject: offer::of_stop(desk.key),
                made: Instant::now(),
            });
        }
        let offer = lock(&self.offers).remove(token)?;
        (offer.made.elapsed() < OFFERED).then_some(offer)
    }
}

fn no_desk(cell: &str) -> String {
    format!(
        "this dashboard was not given the file of cell {cell}, so that nothing can be done to it from here"
    )
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn random() -> Result<String, getrandom::Error> {
    let mut bytes = [0; TOKEN];
    getrandom::fill(&mut bytes)?;
    Ok(hexadecimal(&bytes))
}

fn hexadecimal(bytes: &[u8]) -> String {
    let digit = |value: u8| char::from_digit(value.into(), 16).unwrap_or_default();
    (bytes.iter())
        .flat_map(|byte| [digit(byte >> 4), digit(byte & 15)])
        .collect()
}

fn bytes(text: &str) -> Option<Vec<u8>> {
    let digits: Option<Vec<u8>> = (text.chars())
        .map(|digit| digit.to_digit(16).and_then(|value| value.try_into().ok()))
        .collect();
    let digits = digits?;
    let (pairs, rest) = digits.as_chunks::<2>();
    rest.is_empty()
        .then(|| pairs.iter().map(|[high, low]| high * 16 + low).collect())
}

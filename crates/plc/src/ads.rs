//! ADS of Beckhoff controllers, with the names of their symbols. The controller needs a route to this host.

use ads::{AmsAddr, Client, Error, Source, Timeouts, index::RW_SYMVAL_BYHANDLE, symbol::Handle};

use crate::{ANSWER, Connection, Controller, DataType, Protocol, ReadError, endpoint, resolve};

/// The protocol.
pub(crate) struct Ads;

/// A runtime of a controller.
#[derive(Debug)]
struct Runtime {
    host: (String, u16),
    runtime: AmsAddr,
}

impl Protocol for Ads {
    fn scheme(&self) -> &'static str {
        "ads"
    }

    fn example(&self) -> &'static str {
        "ads://10.0.0.9/10.0.0.9.1.1:851"
    }

    /// Host, and `AmsNetId:port`, the former of six numbers.
    fn controller(&self, rest: &str) -> Option<Box<dyn Controller>> {
        let (host, runtime) = rest.split_once('/')?;
        let (net_id, _) = runtime.split_once(':')?;
        // The parser fills an incomplete one with ones.
        if net_id.split('.').count() != 6 {
            return None;
        }
        Some(Box::new(Runtime {
            host: endpoint(host, ads::PORT)?,
            runtime: runtime.parse().ok()?,
        }))
    }
}

impl Controller for Runtime {
    fn check(&self, address: &str, _data_type: DataType) -> Result<(), String> {
        let is_name = |one: char| one.is_alphanumeric() || "_.[]^,".contains(one);
        if address.is_empty() || !address.chars().all(is_name) {
            return Err(format!(
                "{address:?} is no name of a symbol, such as \"MAIN.clamped\""
            ));
        }
        Ok(())
    }

    fn connect(&self) -> Result<Box<dyn Connection>, String> {
        let client = Client::new(resolve(&self.host)?, Timeouts::new(ANSWER), Source::Auto);
        let client = client.map_err(|error| error.to_string())?;
        Ok(Box::new(Open {
            client,
            runtime: self.runtime,
        }))
    }
}

struct Open {
    client: Client,
    runtime: AmsAddr,
}

impl Connection for Open {
    fn read(&mut self, address: &str, data_type: DataType) -> Result<f64, ReadError> {
        let device = self.client.device(self.runtime);
        let size = data_type.size();
        let mut bytes = [0; 8];
        // A handle of its own for each reading: a controller that was loaded anew has others.
        let handle = Handle::new(device, address).map_err(|error| failed(&error))?;
        let length = device.read(RW_SYMVAL_BYHANDLE, handle.raw(), &mut bytes[..size]);
        // What was read, behind its own length.
        let length = length.map_err(|error| failed(&error))?;
        if length != size {
            let name = data_type.name();
            return Err(ReadError::Refused(format!(
                "the symbol has {length} bytes, a {name} has {size}"
            )));
        }
        // Least significant byte first.
        bytes[..size].reverse();
        Ok(data_type.decode(bytes))
    }
}

fn failed(error: &Error) -> ReadError {
    match error {
        Error::Ads(..) => ReadError::Refused(format!("the controller answers: {error}")),
        Error::Io(..) | Error::Reply(..) | Error::Overflow(_) => ReadError::Lost(error.to_string()),
    }
}

//! ADS of Beckhoff controllers. The controller needs a route to this host.

use ads::{
    AmsAddr, AmsNetId, Client, Error, Source, Timeouts, index::RW_SYMVAL_BYHANDLE, symbol::Handle,
};
use plc::{DataType, ads::Runtime};

use crate::{ANSWER, Connection, ReadError, decode, resolve};

/// See [`crate::connect`].
pub(crate) fn connect(runtime: &Runtime) -> Result<Box<dyn Connection>, String> {
    let client = Client::new(resolve(&runtime.host)?, Timeouts::new(ANSWER), Source::Auto);
    let client = client.map_err(|error| error.to_string())?;
    Ok(Box::new(Open {
        client,
        runtime: AmsAddr::new(AmsNetId(runtime.net_id), runtime.port),
    }))
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
        Ok(decode(data_type, bytes))
    }
}

fn failed(error: &Error) -> ReadError {
    match error {
        Error::Ads(..) => ReadError::Refused(format!("the controller answers: {error}")),
        Error::Io(..) | Error::Reply(..) | Error::Overflow(_) => ReadError::Lost(error.to_string()),
    }
}

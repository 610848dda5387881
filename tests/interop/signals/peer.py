"""A controller beside the machine, by somebody else's server: the simulator of pymodbus, snap7.server, or pyads.testserver.

    peer.py modbus|s7|ads PORT

Commands come as lines of JSON, {"name": value}; each is answered by a line once the server holds the values. The memory:

| name      | modbus                       | s7                | ads                |
|-----------|------------------------------|-------------------|--------------------|
| clamped   | discrete input 5             | DB1.DBX0.3        | MAIN.clamped BOOL  |
| present   | bit 2 of holding register 7  | M4.1              | MAIN.present BOOL  |
| raw       | input register 30, int16     | DB1.DBW2, int16   | MAIN.raw INT       |
| exact     | holding 40, 41, float32      | DB1.DBD4, float32 | MAIN.exact REAL    |
| swapped   | holding 50, 51, low first    | DB1.DBD8, float32 | MAIN.double LREAL  |
"""
import json
import struct
import sys

KIND, PORT = sys.argv[1], int(sys.argv[2])
VALUES = {"clamped": True, "present": True, "raw": 215, "exact": 21.5, "swapped": 1.25}


def modbus():
    import asyncio

    from pymodbus.server import ModbusTcpServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    device = None

    def blocks():
        registers = struct.unpack(">HH", struct.pack(">f", VALUES["exact"]))
        high, low = struct.unpack(">HH", struct.pack(">f", VALUES["swapped"]))
        raw = struct.unpack(">H", struct.pack(">h", VALUES["raw"]))[0]
        word = lambda address, value: SimData(address, values=value, datatype=DataType.REGISTERS)  # noqa: E731
        return (
            [SimData(0, values=[False] * 16, datatype=DataType.BITS)],
            [SimData(0, values=[False] * 5 + [VALUES["clamped"]] + [False] * 10, datatype=DataType.BITS)],
            [word(7, VALUES["present"] << 2), word(40, list(registers)), word(50, [low, high])],
            [word(30, raw)],
        )

    async def serve():
        nonlocal device
        server = ModbusTcpServer(SimDevice(id=1, simdata=blocks()), address=("127.0.0.1", PORT))
        await server.serve_forever(background=True)
        yield_ready()
        loop = asyncio.get_running_loop()
        while line := await loop.run_in_executor(None, sys.stdin.readline):
            VALUES.update(json.loads(line))
            fresh = ModbusTcpServer(SimDevice(id=1, simdata=blocks()), address=("127.0.0.1", PORT))
            server.context = fresh.context
            yield_ready()

    asyncio.run(serve())


def s7():
    from snap7.server import Server
    from snap7.type import SrvArea

    block, flags = bytearray(12), bytearray(8)

    def put():
        block[0] = VALUES["clamped"] << 3
        struct.pack_into(">hff", block, 2, VALUES["raw"], VALUES["exact"], VALUES["swapped"])
        flags[4] = VALUES["present"] << 1

    server = Server(log=False)
    server.host = "127.0.0.1"
    server.register_area(SrvArea.DB, 1, block)
    server.register_area(SrvArea.MK, 0, flags)
    put()
    server.start(PORT)
    commands(put)


def ads():
    from pyads import constants
    from pyads.testserver import AdsTestServer, AdvancedHandler, PLCVariable

    kinds = {"clamped": "BIT", "present": "BIT", "raw": "INT16", "exact": "REAL32", "swapped": "REAL64"}
    forms = {"clamped": "<?", "present": "<?", "raw": "<h", "exact": "<f", "swapped": "<d"}
    handler = AdvancedHandler()
    variables = {}
    for name, kind in kinds.items():
        symbol = f"MAIN.{'double' if name == 'swapped' else name}"
        variables[name] = PLCVariable(symbol, bytes(1), getattr(constants, f"ADST_{kind}"), kind)
        handler.add_variable(variables[name])

    def put():
        for name, variable in variables.items():
            variable.value = struct.pack(forms[name], VALUES[name])

    put()
    AdsTestServer(handler, port=PORT, logging=False).start()
    commands(put)


def yield_ready():
    print("ready", flush=True)


def commands(put):
    yield_ready()
    for line in sys.stdin:
        VALUES.update(json.loads(line))
        put()
        yield_ready()


{"modbus": modbus, "s7": s7, "ads": ads}[KIND]()

"""pymodbus behind one adapter: registers by RTU or TCP, every reply checked, reads and writes apart.

pymodbus breaks its interface in minor releases, returns a device's exceptions instead of raising them, accepts replies
that are too short, and after an RTU time-out hands out late replies as if they were the next ones. That ends here.
"""

import logging
from collections.abc import Callable, Sequence

import numpy as np
import serial
from numpy.typing import NDArray
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException
from pymodbus.pdu import ModbusPDU

from daq.errors import BadReply, DeviceError, LinkError, NoReply
from daq.modbus_bulk import PER_READ, exception_words, read_rtu, read_tcp

logging.getLogger("pymodbus").addHandler(logging.NullHandler())
logging.getLogger("pymodbus").propagate = False  # what it has to say is raised below, in the operator's words

KINDS = {3: "holding", 4: "input"}


class Modbus:
    """Registers of one unit.

    Raises
    ------
    LinkError : the port is not there or nobody listens.
    """

    def __init__(self, port: str, baud: int, unit_id: int, timeout_s: float = 1.0) -> None:
        self.port = port
        self.unit = unit_id
        self._timeout_s = timeout_s
        self._rtu = not port.startswith("tcp://")
        if self._rtu:
            self._client = ModbusSerialClient(port, baudrate=baud, timeout=timeout_s, retries=0)
        else:
            host, _, number = port.removeprefix("tcp://").rpartition(":")
            if not host or not number.isdigit():
                raise LinkError(f"port {port} is not tcp://host:port")
            self._client = ModbusTcpClient(host, port=int(number), timeout=timeout_s, retries=0)
        self._connect()

    def _connect(self) -> None:
        try:
            there = self._client.connect()
        except (OSError, ModbusException) as e:
            raise LinkError(f"port {self.port} cannot be opened: {e}") from None
        if not there:
            raise LinkError(f"port {self.port} cannot be opened; check the cable and the port in the rig file")

    def _ask(self, what: str, call: Callable[[], ModbusPDU]) -> ModbusPDU:
        try:
            if not self._client.connected:
                self._connect()
            reply = call()
        except (ModbusException, OSError, TypeError) as e:
            # TypeError: pyserial's word for a descriptor that is gone
            raise NoReply(f"port {self.port}: {what}: {e}") from None
        if reply.isError():
            code = getattr(reply, "exception_code", 0)
            raise DeviceError(f"port {self.port}: {what}: {exception_words(code)}")
        return reply

    def _registers(self, what: str, reply: ModbusPDU, count: int) -> list[int]:
        if len(reply.registers) != count:
            raise BadReply(f"port {self.port}: {what}: {len(reply.registers)} registers came for {count}")
        return list(reply.registers)

    def read(self, function: int, address: int, count: int) -> list[int]:
        """`count` (1 to 125) holding registers (function 3) or input registers (4)."""
        what = f"{KINDS[function]} registers {address} to {address + count - 1}"
        call = self._client.read_holding_registers if function == 3 else self._client.read_input_registers
        return self._registers(what, self._ask(what, lambda: call(address, count=count, device_id=self.unit)), count)

    def bulk(
        self, function: int, address: int, count: int, at_once: int, per_read: int = PER_READ
    ) -> NDArray[np.uint16]:
        """`count` registers, of any number, at the wire's own speed; on TCP with `at_once` requests in flight."""
        if not self._client.connected:
            self._connect()
        link = self._client.socket
        try:
            if isinstance(link, serial.Serial):
                return read_rtu(link, self.unit, function, address, count, per_read)
            assert link is not None, "a connected client has its socket"
            link.settimeout(self._timeout_s)
            return read_tcp(link, self.unit, function, address, count, at_once, per_read)
        except (LinkError, DeviceError) as e:
            raise type(e)(
                f"port {self.port}: {KINDS[function]} registers {address} to {address + count - 1}: {e}"
            ) from None

    def write(self, address: int, values: Sequence[int]) -> None:
        """Write holding registers in one request, once."""
        what = f"writing holding registers {address} to {address + len(values) - 1}"
        self._ask(what, lambda: self._client.write_registers(address, list(values), device_id=self.unit))

    def drain(self) -> None:
        """Forget what is under way, so that no late reply is taken for the next one."""
        if not self._rtu:
            self._client.close()  # a new connection has no old replies
            self._connect()
            return
        if not self._client.connected:
            self._connect()
        line = self._client.socket
        assert isinstance(line, serial.Serial), "a connected RTU client has its line"
        old, line.timeout = line.timeout, 0.05
        try:
            while line.read(4096):
                pass
        except (OSError, TypeError) as e:
            raise LinkError(f"port {self.port} failed: {e}") from None
        finally:
            line.timeout = old

    def close(self) -> None:
        self._client.close()

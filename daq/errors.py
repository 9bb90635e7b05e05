"""The errors of acquisition and storage, each saying what the operator can do.

DaqError                    something could not be done; the message is for the operator
├── SettingsError           a rig, test or table file is wrong; names file, line, key and limit
├── ImportFileError         a CSV or LVM file does not hold one clean record
├── StoreError              a data folder or a run in it cannot be read or written
│   └── RunNotFound         no run of that id
├── LinkError               the wire: port missing, silent, cut
│   ├── NoReply             nothing came in time; a read may be tried again
│   └── BadReply            what came was not what was asked for; a read may be tried again
├── DeviceError             the device refused, or is not what the rig file says
├── AcquisitionError        a drop did not become a run; `outcome` names why
└── RigBusy                 another process holds the rig
"""


class DaqError(Exception):
    """Something could not be done; the message says what, the limit and the way out."""


class SettingsError(DaqError):
    """A rig, test or table file is wrong."""


class ImportFileError(DaqError):
    """A file to import does not hold one clean record."""


class StoreError(DaqError):
    """A data folder or a run in it cannot be read or written."""


class RunNotFound(StoreError):
    """No run of that id in the data folder."""


class SeriesNotFound(DaqError):
    """No run is in a series of that name."""


class LinkError(DaqError):
    """The wire failed."""


class NoReply(LinkError):
    """Nothing came in time."""


class BadReply(LinkError):
    """What came was not what was asked for."""


class DeviceError(DaqError):
    """The device refused, or is not what the rig file says."""


class AcquisitionError(DaqError):
    """A drop did not become a run.

    Parameters
    ----------
    outcome : name of the end, one of `no-trigger`, `interlock`, `aborted`, `held`, `stale`, `unsaved`.
    """

    def __init__(self, outcome: str, message: str) -> None:
        super().__init__(message)
        self.outcome = outcome


class RigBusy(DaqError):
    """Another process holds the rig."""

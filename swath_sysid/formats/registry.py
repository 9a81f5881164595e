"""Every format that a record may have, by its first bytes and its ending: lists of formats are made from this one."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TankFormat:
    """A format of data acquisition."""

    what: str
    start: bytes  #: Its first bytes; empty where only the ending tells it.
    ending: str
    module: str  #: In `swath_sysid.formats.tank`.
    library: str  #: As pip names it.
    member: str = ''  #: A file in it, if it is a zip archive.


TANK = (
    TankFormat('a MATLAB file', b'MATLAB 5.0 MAT-f', '.mat', 'mat', 'scipy'),
    TankFormat('a MATLAB file of version 7.3', b'MATLAB 7.3 MAT-f', '.mat', 'hdf5', 'h5py'),
    TankFormat('a LabVIEW TDMS file', b'TDSm', '.tdms', 'tdms', 'npTDMS'),
    TankFormat('a LabVIEW measurement file', b'LabVIEW Measurem', '.lvm', 'lvm', 'numpy'),
    TankFormat('a spreadsheet', b'PK\x03\x04', '.xlsx', 'xlsx', 'openpyxl', 'xl/workbook.xml'),
    TankFormat('an archive of tables', b'PK\x03\x04', '.zip', 'archive', 'numpy'),
    TankFormat('a Parquet table', b'PAR1', '.parquet', 'parquet', 'pyarrow'),
    TankFormat('an HDF5 file', b'\x89HDF\r\n\x1a\n', '.h5', 'hdf5', 'h5py'),
    TankFormat('a PX4 log', b'ULog\x01\x12\x35', '.ulg', 'ulg', 'pyulog'),
    TankFormat('an ArduPilot log', b'\xa3\x95', '.bin', 'dataflash', 'pymavlink'),
    TankFormat('an ArduPilot log in text', b'FMT, ', '.bin', 'dataflash', 'pymavlink'),
    TankFormat('an OpenFAST output', b'', '.outb', 'outb', 'numpy'),
    TankFormat('an NMEA log', b'', '.nmea', 'nmea', 'numpy'),
)
TANK_ENDINGS = tuple(dict.fromkeys(each.ending for each in TANK))
#: Of the storage files of bags, with their first bytes.
BAGS = {'.mcap': b'\x89MCAP0\r\n', '.db3': b'SQLite format 3\0'}
ENDINGS = ('.csv', *BAGS, '.txt', '.tsv', '.out', *TANK_ENDINGS)
TABLES = f'CSV, {", ".join(TANK_ENDINGS[:-1])} or {TANK_ENDINGS[-1]}'  #: As a sentence lists them.

#: First bytes of files that are none of ours, and what to do with them.
FOREIGN = {
    b'#ROSBAG V': 'a ROS 1 bag: convert it with rosbags-convert --src OLD.bag --dst NEW',
    b'PK\x03\x04': 'a zip archive: unpack it, or name it .zip if it holds CSV files',
    b'\x1f\x8b': 'compressed with gzip: unpack it first',
    b'\x28\xb5\x2f\xfd': 'compressed with zstd: unpack it, or give its bag folder',
    b'\xd0\xcf\x11\xe0': 'an old spreadsheet: save it as .xlsx or CSV',
    b'\xfa\xff': 'a binary MTi log: export it as text in MT Manager',
    b'CDF\x01': 'a netCDF file of version 3: convert it with nccopy -k netCDF-4 OLD.nc NEW.nc',
    b'CDF\x02': 'a netCDF file of version 3: convert it with nccopy -k netCDF-4 OLD.nc NEW.nc',
    b'{"': 'a JSON file: export a table, one row for each sample, as CSV',
    b'[{"': 'a JSON file: export a table, one row for each sample, as CSV',
    b'<?xml': 'an XML file: export a table, one row for each sample, as CSV',
    b'<!DOCTYPE': 'a web page: download the file itself',
    b'%PDF': 'a PDF document: export its table as CSV',
    b'format: swath_sysid': 'a model file, where a record is expected: the record comes first',
}

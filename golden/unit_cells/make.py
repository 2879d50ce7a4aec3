"""Unit cells of a pillar that fills its cell more and more, as h5py, Tidy3D and h5netcdf write them.

Needs h5py, h5netcdf and xarray. Tidy3D's `DataArray.to_hdf5` makes a group with one data set for the values and one for each axis.
"""

import h5py
import numpy as np
import xarray as xr

widths, heights, wavelengths = np.arange(80, 321, 10.0), np.arange(560, 641, 40.0), np.arange(600, 661, 20.0)
frequencies = 2.99792458e17 / wavelengths
w, h, l = np.meshgrid(widths, heights, wavelengths, indexing="ij")
index = 1 + 1.3 * (w / 400) ** 1.6
t = (0.97 - 0.05 * np.sin(w / 80) ** 2) * np.exp(2j * np.pi * index * h / l)
axes = {"width": widths / 1e3, "height": heights / 1e3, "f": frequencies}

for name, libver in [("tidy3d.hdf5", "earliest"), ("latest.hdf5", "latest")]:
    with h5py.File(name, "w", libver=libver) as file:
        group = file.create_group("transmission")
        group["__xarray_dataarray_variable__"] = t
        for axis, values in axes.items():
            group[axis] = values

with h5py.File("chunks.h5", "w", userblock_size=512) as file:
    file.create_dataset("t", data=t.astype("c8"), chunks=(10, 2, 3), compression="gzip", shuffle=True)
    file["radius_nm"] = (widths / 2).astype("i4")
    file["height"], file["wavelength"] = heights * 1e-9, wavelengths * 1e-9

array = xr.DataArray(t[:, 1, 1], coords={"width": axes["width"], "f": frequencies[1]}, dims=("width",))
xr.Dataset({"t_real": array.real, "t_imag": array.imag}).to_netcdf("parts.nc", engine="h5netcdf")

// Finds and loads the module that writes netCDF files.
#include "netcdf_file.h"

#include <rtsg/core/module.h>

namespace rtsg {

#ifdef RTSG_NO_NETCDF

Result<const NetcdfWriter*> netcdfWriter() {
    return fail("SOFA files are not written: this build leaves them out (RTSG_SOFA=OFF, or netCDF was not there)");
}

#else

namespace {

#define RTSG_NETCDF_TEXT_OF(name) #name
#define RTSG_NETCDF_TEXT(name) RTSG_NETCDF_TEXT_OF(name)

Result<const NetcdfWriter*> loadNetcdf() {
    const auto symbol = loadModule("rtsg_netcdf", RTSG_NETCDF_TEXT(RTSG_NETCDF_SYMBOL), "SOFA files need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<const NetcdfWriter* (*)()>(*symbol)();
}

}  // namespace

Result<const NetcdfWriter*> netcdfWriter() {
    static const Result<const NetcdfWriter*> loaded = loadNetcdf();
    return loaded;
}

#endif

}  // namespace rtsg

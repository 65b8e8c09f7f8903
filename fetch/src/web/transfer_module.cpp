// Finds the module that transfers files by libcurl.
#include "transfer_module.h"

#include <rtsg/core/module.h>

namespace rtsg::fetch {

Result<const TransferModule*> transferModule() {
#ifdef RTSG_NO_FETCH
    return fail("this build fetches nothing from a network (libcurl4-gnutls-dev, RTSG_FETCH)");
#else
    const auto symbol = loadModule("rtsg_curl", RTSG_CURL_SYMBOL, "files from the network need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<const TransferModule* (*)()>(*symbol)();
#endif
}

}  // namespace rtsg::fetch

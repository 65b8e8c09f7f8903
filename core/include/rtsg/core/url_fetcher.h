// UrlFetcher: fetches files from network addresses for Resources (resource.h), which knows no network.
//
// The program uses the one in rtsg/fetch/web_fetcher.h. Invariant: an address has one content as long as the fetcher
// lives, so that all who open it see the same bytes. Threading: any thread.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct FetchedContent {
    std::string address;    // the address that answered, after redirects
    std::string mediaType;  // as the server states it, without parameters; may be empty
    int descriptor = -1;    // a file with the content, at its beginning; the caller closes it
};

class UrlFetcher {
  public:
    virtual ~UrlFetcher() = default;

    /// Waits for the content at an address in the form that WebAddress (web_address.h) gives it. Errors: it is not
    /// allowed; it has more than `maximumBytes`; the transfer failed.
    virtual Result<FetchedContent> fetch(const std::string& address, std::uint64_t maximumBytes) = 0;
    /// Starts a fetch. Returns true as long as fetch() would wait; false if this fetcher can only fetch while one
    /// waits.
    virtual bool awaits(const std::string& address, std::uint64_t maximumBytes) = 0;
};

}  // namespace rtsg

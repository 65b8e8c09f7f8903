// Bytes of any kind as the answer of a web server, as an entry of the cache, and as an address. A fetch is a file or an
// error; an entry that is believed has a hash; an address in its normal form is its own normal form.
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <rtsg/core/web_address.h>
#include <rtsg/fetch/web_fetcher.h>

#include "web/disk_cache.h"

namespace {

using namespace rtsg;
namespace fs = std::filesystem;

void expect(bool condition) {
    if (!condition) std::abort();
}

void checkAddress(std::string_view text) {
    const auto address = WebAddress::parse(text);
    if (!address) return;
    const auto again = WebAddress::parse(address->text());
    expect(again && *again == *address);
    if (const auto inner = address->resolve(text)) expect(WebAddress::parse(inner->text()).has_value());
}

/// A folder that goes with the process.
struct Folder {
    fs::path path = fs::temp_directory_path() / ("rtsg_fetch_fuzz_" + std::to_string(::getpid()));
    Folder() { fs::create_directories(path); }
    ~Folder() { fs::remove_all(path); }
};

void checkEntry(std::string_view bytes) {
    static const Folder folder;
    static const fetch::DiskCache cache(folder.path / "cache", 1 << 20);
    const fetch::TransferModule module{nullptr, [](std::string_view) { return std::string(64, 'a'); }};
    std::ofstream(folder.path / "cache" / "entries" / std::string(64, 'a'), std::ios::binary) << bytes;
    const auto entry = cache.find("http://localhost/a", module);
    expect(!entry || entry->hash.size() == 64);
    if (entry) (void)cache.content(entry->hash, 1 << 20, module);
}

/// Answers who connects with the bytes, up to three times, as a redirect may come back.
void checkAnswer(std::string_view bytes) {
    const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in at{};
    at.sin_family = AF_INET, at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof(at);
    expect(::bind(listener, reinterpret_cast<const sockaddr*>(&at), sizeof(at)) == 0 && ::listen(listener, 4) == 0 &&
           ::getsockname(listener, reinterpret_cast<sockaddr*>(&at), &length) == 0);
    std::thread server([&] {
        for (int one = 0; one >= 0;) {
            one = ::accept(listener, nullptr, nullptr);
            char request[1024];
            if (one >= 0) (void)!::recv(one, request, sizeof(request), 0);
            if (one >= 0) (void)::send(one, bytes.data(), bytes.size(), MSG_NOSIGNAL);
            if (one >= 0) ::close(one);
        }
    });
    const std::string address = "http://127.0.0.1:" + std::to_string(ntohs(at.sin_port)) + "/a";
    FetchSettings settings;
    settings.connectSeconds = settings.stallSeconds = settings.totalSeconds = 2;
    settings.rules.allowed.push_back(*WebAddress::parse(address));
    WebFetcher fetcher(std::move(settings));
    const auto content = fetcher.fetch(address, 1 << 16);
    expect(content ? content->descriptor >= 0 : !content.error().text.empty());
    if (content) expect(::lseek(content->descriptor, 0, SEEK_END) <= 1 << 16);
    if (content) ::close(content->descriptor);
    ::shutdown(listener, SHUT_RDWR);
    server.join();
    ::close(listener);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    checkAddress(bytes);
    checkEntry(bytes);
    checkAnswer(bytes);
    return 0;
}

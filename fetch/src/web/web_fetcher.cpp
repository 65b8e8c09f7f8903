// Fetches each address once: from what a log brought, from the folder of earlier ones, or from its server.
#include <rtsg/fetch/web_fetcher.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/resource.h>

#include "disk_cache.h"
#include "held_file.h"
#include "transfer_module.h"

namespace rtsg {

namespace {

using fetch::CacheEntry;
using fetch::HeldFile;
using fetch::TransferAnswer;
using fetch::TransferModule;
using fetch::TransferRequest;
using Clock = std::chrono::steady_clock;

constexpr int kMaxRedirects = 5;
constexpr std::size_t kThreads = 4;
constexpr auto kPause = std::chrono::seconds(5);                // before what failed is tried again
constexpr std::uint64_t kMemoryStep = std::uint64_t{16} << 20;  // bytes between two looks at the process's memory

struct Content {
    std::string source, mediaType, hash;
    HeldFile file;
};

/// One address. While a transfer runs, only its thread uses the transfer's data.
struct Entry {
    enum class State : std::uint8_t { unknown, waiting, running, there, failed };
    State state = State::unknown;
    Content content;
    Diagnostic error;
    Clock::time_point failedAt;
    FetchedFile expected;  // a log says that it is this content
    bool isListed = false;
};

bool isRedirect(int status) {
    return status == 301 || status == 302 || status == 303 || status == 307 || status == 308;
}

Result<Content> heldContent(std::string_view bytes, std::string source, std::string mediaType, std::string hash) {
    Content content{std::move(source), std::move(mediaType), std::move(hash), HeldFile()};
    if (auto ok = mayHold(bytes.size()); !ok) return std::unexpected(ok.error());
    if (!content.file.valid() || !content.file.append(bytes) || !content.file.seal())
        return fail("there is no room for it in memory");
    return content;
}

}  // namespace

struct WebFetcher::State {
    explicit State(FetchSettings given)
        : settings(std::move(given)), cache(std::move(settings.cache), settings.cacheBytes) {}

    ~State() {
        {
            const std::scoped_lock lock(mutex);
            stopped = true;
        }
        changed.notify_all();
        threads.clear();  // joins them
    }
    State(const State&) = delete;
    State& operator=(const State&) = delete;

    /// Null: there are as many addresses as there may be.
    Entry* entryOf(const std::string& address) {
        const auto found = entries.find(address);
        if (found != entries.end()) return &found->second;
        return entries.size() < settings.totalFiles ? &entries[address] : nullptr;
    }

    bool mayTryAgain(const Entry& entry) const {
        return entry.state == Entry::State::failed && Clock::now() - entry.failedAt > kPause;
    }

    /// Called with the lock held, and while nobody else runs this entry.
    void run(std::unique_lock<std::mutex>& lock, Entry& entry, const std::string& address, std::uint64_t maximumBytes) {
        entry.state = Entry::State::running;
        const FetchedFile expected = entry.expected;
        lock.unlock();
        auto content = load(address, maximumBytes, expected);
        lock.lock();
        if (content && usedBytes + content->file.size() > settings.totalBytes)
            content =
                fail(fmt::format("all files from the network together have more than {} bytes", settings.totalBytes));
        if (content) {
            usedBytes += content->file.size();
            entry.content = std::move(*content);
            entry.state = Entry::State::there;
        } else {
            entry.error = std::move(content.error());
            entry.failedAt = Clock::now();
            entry.state = Entry::State::failed;
        }
        changed.notify_all();
    }

    void work() {
        std::unique_lock lock(mutex);
        for (;;) {
            changed.wait(lock, [&] { return stopped || !queue.empty(); });
            if (stopped) return;
            const auto [address, maximumBytes] = std::move(queue.front());
            queue.pop_front();
            Entry& entry = entries.at(address);
            if (entry.state == Entry::State::waiting) run(lock, entry, address, maximumBytes);
        }
    }

    /// Follows redirects, each of which must be allowed.
    Result<Content> load(const std::string& address, std::uint64_t maximumBytes, const FetchedFile& expected) {
        if (!expected.hash.empty())
            if (const auto module = fetch::transferModule())
                if (const auto bytes = cache.content(expected.hash, maximumBytes, **module))
                    return heldContent(*bytes, expected.source, expected.mediaType, expected.hash);
        auto at = WebAddress::parse(address);
        const Clock::time_point end =
            Clock::now() + std::chrono::milliseconds(static_cast<std::int64_t>(1000 * settings.totalSeconds));
        for (int hop = 0; at && hop <= kMaxRedirects; ++hop) {
            const auto leads = [&](const Diagnostic& why) {
                if (hop == 0) return why.text;
                return fmt::format("it leads to '{}': {}", urlForMessage(at->text()), why.text);
            };
            if (auto ok = settings.rules.check(*at); !ok) return fail(leads(ok.error()));
            std::string next;
            auto content = ask(*at, maximumBytes, end, next);
            if (!content) return fail(content.error().code, leads(content.error()));
            if (next.empty()) {
                if (!expected.hash.empty() && content->hash != expected.hash)
                    return fail(fmt::format("it is not what the session had, whose SHA-256 is {}", expected.hash));
                return content;
            }
            at = at->resolve(next);
        }
        if (!at) return fail("it leads to no http or https address: " + at.error().text);
        return fail(fmt::format("it leads from address to address, more than {} times", kMaxRedirects));
    }

    /// One request. `next` is where a redirect leads; the content is nothing then.
    Result<Content> ask(const WebAddress& at, std::uint64_t maximumBytes, Clock::time_point end, std::string& next) {
        const auto found = fetch::transferModule();
        if (!found) return std::unexpected(found.error());
        const TransferModule& module = **found;
        const std::string address = at.text();
        const auto known = cache.find(address, module);
        std::optional<std::string> old;
        if (settings.offline) return kept(address, known, maximumBytes, module);
        if (known && !(known->etag.empty() && known->lastModified.empty()))
            old = cache.content(known->hash, maximumBytes, module);
        Content content{address, {}, {}, HeldFile()};
        if (!content.file.valid()) return fail("the system gives no memory for a file");
        TransferRequest request = requestFor(at, maximumBytes, end, content.file);
        if (old) {
            request.etag = known->etag;
            request.lastModified = known->lastModified;
        }
        const TransferAnswer answer = module.get(request);
        if (!answer.problem.empty()) {
            const bool isKept = known && cache.content(known->hash, maximumBytes, module);
            return fail(answer.problem + (isKept ? "; the cache has an earlier copy, which --offline takes" : ""));
        }
        if (isRedirect(answer.status)) {
            if (answer.location.empty()) return fail("the server says that it is elsewhere, and not where");
            next = answer.location;
            return content;
        }
        if (answer.status == 304) {
            if (!old) return fail("the server says that it has not changed, and nobody has asked");
            return heldContent(*old, address, known->mediaType, known->hash);
        }
        if (answer.status != 200) return fail(fmt::format("the server answers {}", answer.status));
        if (auto ok = mayHold(content.file.size()); !ok) return std::unexpected(ok.error());
        const std::string bytes = content.file.bytes();
        content.mediaType = answer.mediaType;
        content.hash = module.sha256(bytes);
        if (!content.file.seal()) return fail("the system does not keep a file in memory");
        if (!answer.cacheControl.contains("no-store"))
            cache.store(address, {answer.mediaType, answer.etag, answer.lastModified, content.hash}, bytes, module);
        return content;
    }

    /// What the cache has of an address, whose server is not asked.
    Result<Content> kept(const std::string& address, const std::optional<CacheEntry>& known, std::uint64_t maximumBytes,
                         const TransferModule& module) const {
        const auto bytes = known ? cache.content(known->hash, maximumBytes, module) : std::nullopt;
        if (!bytes) return fail("the cache does not have it, and --offline asks no server");
        if (settings.fromCache) settings.fromCache(address);
        return heldContent(*bytes, address, known->mediaType, known->hash);
    }

    TransferRequest requestFor(const WebAddress& at, std::uint64_t maximumBytes, Clock::time_point end,
                               HeldFile& file) {
        TransferRequest request;
        request.address = at.text();
        request.certificates = settings.certificates.string();
        request.connectSeconds = settings.connectSeconds;
        request.stallSeconds = settings.stallSeconds;
        request.totalSeconds = std::chrono::duration<double>(end - Clock::now()).count();
        request.maximumBytes = maximumBytes;
        request.mayConnect = [this, at](const sockaddr& server) { return settings.rules.mayConnect(at, server); };
        request.take = [&file](std::string_view bytes) {
            const bool isStep = file.size() / kMemoryStep != (file.size() + bytes.size()) / kMemoryStep;
            return (!isStep || mayHold(kMemoryStep).has_value()) && file.append(bytes);
        };
        request.stop = &stopped;
        return request;
    }

    FetchSettings settings;
    const fetch::DiskCache cache;
    mutable std::mutex mutex;
    std::condition_variable changed;
    std::atomic<bool> stopped = false;
    std::map<std::string, Entry> entries;
    std::vector<std::string> order;  // of fetched files, in the order in which they were first opened
    std::deque<std::pair<std::string, std::uint64_t>> queue;
    std::uint64_t usedBytes = 0;
    bool hasKeptBytes = false;
    std::vector<std::jthread> threads;  // the last: they use all of the above
};

WebFetcher::WebFetcher(FetchSettings settings) : state_(std::make_unique<State>(std::move(settings))) {}
WebFetcher::~WebFetcher() = default;

const FetchSettings& WebFetcher::settings() const {
    return state_->settings;
}

Result<FetchedContent> WebFetcher::fetch(const std::string& address, std::uint64_t maximumBytes) {
    State& s = *state_;
    std::unique_lock lock(s.mutex);
    Entry* entry = s.entryOf(address);
    if (!entry) return fail(fmt::format("a session fetches no more than {} files", s.settings.totalFiles));
    const bool isNew = entry->state == Entry::State::unknown || entry->state == Entry::State::waiting;
    if (isNew || (!s.settings.inBackground && s.mayTryAgain(*entry))) s.run(lock, *entry, address, maximumBytes);
    s.changed.wait(lock, [&] { return entry->state == Entry::State::there || entry->state == Entry::State::failed; });
    if (entry->state == Entry::State::failed) return std::unexpected(entry->error);
    const Content& content = entry->content;
    if (content.file.size() > maximumBytes)
        return fail(fmt::format("it has more than {} bytes; --limit bytes=N raises this", maximumBytes));
    const int descriptor = content.file.opened();
    if (descriptor < 0) return fail("the system opens no more files");
    if (!std::exchange(entry->isListed, true)) s.order.push_back(address);
    return FetchedContent{content.source, content.mediaType, descriptor};
}

bool WebFetcher::awaits(const std::string& address, std::uint64_t maximumBytes) {
    State& s = *state_;
    if (!s.settings.inBackground) return false;
    const std::scoped_lock lock(s.mutex);
    Entry* entry = s.entryOf(address);
    if (!entry) return false;
    if (entry->state == Entry::State::unknown || s.mayTryAgain(*entry)) {
        entry->state = Entry::State::waiting;
        s.queue.emplace_back(address, maximumBytes);
        if (s.threads.size() < kThreads) s.threads.emplace_back([&s] { s.work(); });
        s.changed.notify_all();
    }
    return entry->state == Entry::State::waiting || entry->state == Entry::State::running;
}

std::size_t WebFetcher::forEachFetched(std::size_t from, bool withBytes,
                                       const std::function<void(FetchedFile)>& take) const {
    const State& s = *state_;
    const std::scoped_lock lock(s.mutex);
    for (; from < s.order.size(); ++from) {
        const Content& content = s.entries.at(s.order[from]).content;
        take({s.order[from], content.source, content.mediaType, content.hash,
              withBytes ? content.file.bytes() : std::string(), withBytes});
    }
    return from;
}

Result<> WebFetcher::keep(FetchedFile file) {
    State& s = *state_;
    for (const std::string* address : {&file.address, &file.source})
        if (auto parsed = WebAddress::parse(*address); !parsed || parsed->text() != *address)
            return fail(fmt::format("'{}' is no address of a fetched file", urlForMessage(*address)));
    const std::scoped_lock lock(s.mutex);
    Entry* entry = s.entryOf(file.address);
    if (!entry || s.usedBytes + file.bytes.size() > s.settings.totalBytes)
        return fail("a session has no more room for fetched files");
    if (entry->state != Entry::State::unknown && entry->state != Entry::State::failed) return {};
    if (!file.hasBytes) {
        entry->expected = std::move(file);
        return {};
    }
    auto content = heldContent(file.bytes, file.source, file.mediaType, file.hash);
    if (!content) return std::unexpected(content.error());
    s.usedBytes += content->file.size();
    s.hasKeptBytes = true;
    entry->content = std::move(*content);
    entry->state = Entry::State::there;
    return {};
}

bool WebFetcher::hasKeptBytes() const {
    const std::scoped_lock lock(state_->mutex);
    return state_->hasKeptBytes;
}

std::filesystem::path userFetchCache() {
    const char* const cache = std::getenv("XDG_CACHE_HOME");
    if (cache && *cache == '/') return std::filesystem::path(cache) / "rtsg" / "web";
    const char* const home = std::getenv("HOME");
    return home && *home == '/' ? std::filesystem::path(home) / ".cache" / "rtsg" / "web" : std::filesystem::path();
}

}  // namespace rtsg

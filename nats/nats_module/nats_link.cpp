// A connection to a NATS server by libnats: messages in and out, and streams of JetStream.
#include "link/nats_link.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <utility>

#include <nats/nats.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace rtsg {

namespace {

constexpr std::int64_t kConnectWithin = 2000, kReconnectEvery = 50, kReconnectJitter = 50;  // ms
constexpr std::int64_t kJetStreamWithin = 2000;                                             // ms
constexpr int kReconnectBuffer = 4 << 20;                                                   // bytes
constexpr int kPendingMessages = 1 << 20, kPendingBytes = 64 << 20;                         // of a subscription
constexpr std::chrono::seconds kCallbacksWithin{2};
constexpr std::size_t kMaxNews = 100;
constexpr int kBatch = 256;                              // messages that are fetched at once
constexpr int kNoStream = 10059, kLastSequence = 10071;  // JetStream's error codes

/// The meaning of a status and the library's message, without the position in its sources.
std::string textOf(natsStatus status) {
    std::string text = natsStatus_GetText(status);
    const char* last = nats_GetLastError(nullptr);
    std::string_view what = last ? last : "";
    if (const std::size_t end = what.find("): "); what.starts_with('(') && end != std::string_view::npos)
        what.remove_prefix(end + 3);
    if (!what.empty() && what != text) text += ": " + std::string(what);
    return text;
}

template <class T, void (*destroy)(T*)>
struct Owned {
    T* it = nullptr;
    Owned() = default;
    ~Owned() { destroy(it); }
    Owned(const Owned&) = delete;
    Owned& operator=(const Owned&) = delete;
};

class Link final : public NatsLink {
  public:
    explicit Link(std::size_t maxWaiting) : maxWaiting_(maxWaiting), call_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
    ~Link() override {
        natsConnection_Close(connection_);
        for (auto& [subject, subscription] : subscriptions_) natsSubscription_Destroy(subscription);
        {
            // The library's threads may still be in a callback of ours.
            std::unique_lock lock(mutex_);
            ended_.wait_for(lock, kCallbacksWithin, [this] { return live_ == 0 && (!connection_ || closed_); });
        }
        jsCtx_Destroy(jetStream_);
        natsConnection_Destroy(connection_);
        natsOptions_Destroy(options_);
        ::close(call_);
    }
    Link(const Link&) = delete;
    Link& operator=(const Link&) = delete;

    std::string open(const NatsSettings& settings) {
        std::vector<const char*> servers;
        for (const std::string& server : settings.servers) servers.push_back(server.c_str());
        natsStatus status = natsOptions_Create(&options_);
        const auto then = [&](auto&& set) {
            if (status == NATS_OK) status = set();
        };
        then([&] { return natsOptions_SetServers(options_, servers.data(), static_cast<int>(servers.size())); });
        then([&] { return natsOptions_SetName(options_, settings.client.c_str()); });
        then([&] { return authenticate(settings); });
        then([&] { return natsOptions_SetTimeout(options_, kConnectWithin); });
        then([&] { return natsOptions_SetMaxReconnect(options_, -1); });
        then([&] { return natsOptions_SetReconnectWait(options_, kReconnectEvery); });
        then([&] { return natsOptions_SetReconnectJitter(options_, kReconnectJitter, kReconnectJitter); });
        then([&] { return natsOptions_SetReconnectBufSize(options_, kReconnectBuffer); });
        then([&] { return natsOptions_SetSendAsap(options_, true); });
        // One thread delivers the messages of all subscriptions, so they stay in order.
        then([&] { return natsOptions_UseGlobalMessageDelivery(options_, true); });
        then([&] { return natsOptions_SetErrorHandler(options_, &Link::failed, this); });
        then([&] { return natsOptions_SetClosedCB(options_, &Link::closed, this); });
        then([&] { return natsConnection_Connect(&connection_, options_); });
        then([&] { return natsConnection_JetStream(&jetStream_, connection_, nullptr); });
        return status == NATS_OK ? std::string() : textOf(status);
    }

    natsStatus authenticate(const NatsSettings& s) {
        natsStatus status = NATS_OK;
        if (!s.user.empty())
            status = s.password.empty() ? natsOptions_SetToken(options_, s.user.c_str())
                                        : natsOptions_SetUserInfo(options_, s.user.c_str(), s.password.c_str());
        if (status == NATS_OK && !s.credentials.empty())
            status = natsOptions_SetUserCredentialsFromFiles(options_, s.credentials.c_str(), nullptr);
        if (status == NATS_OK && !s.authorities.empty())
            status = natsOptions_LoadCATrustedCertificates(options_, s.authorities.c_str());
        if (status == NATS_OK && !s.certificate.empty())
            status = natsOptions_LoadCertificatesChain(options_, s.certificate.c_str(), s.key.c_str());
        return status;
    }

    std::size_t maxPayload() const override {
        return static_cast<std::size_t>(std::max<std::int64_t>(0, natsConnection_GetMaxPayload(connection_)));
    }
    bool connected() const override { return natsConnection_Status(connection_) == NATS_CONN_STATUS_CONNECTED; }
    std::uint64_t dropped() const override { return dropped_; }
    std::vector<std::string> takeNews() override {
        const std::scoped_lock lock(mutex_);
        return std::exchange(news_, {});
    }
    int descriptor() const override { return call_; }
    std::size_t waiting() const override {
        const std::scoped_lock lock(mutex_);
        return bytes_;
    }
    bool take(NatsMessage& into) override {
        const std::scoped_lock lock(mutex_);
        if (waiting_.empty()) {
            eventfd_t calls = 0;
            (void)::eventfd_read(call_, &calls);
            return false;
        }
        into = std::move(waiting_.front());
        waiting_.pop_front();
        bytes_ -= into.bytes.size();
        return true;
    }

    std::string publish(const std::string& subject, const std::string& reply,
                        std::span<const std::byte> bytes) override {
        const auto size = static_cast<int>(bytes.size());
        const natsStatus status =
            reply.empty()
                ? natsConnection_Publish(connection_, subject.c_str(), bytes.data(), size)
                : natsConnection_PublishRequest(connection_, subject.c_str(), reply.c_str(), bytes.data(), size);
        return status == NATS_OK ? std::string() : textOf(status);
    }
    std::string subscribe(const std::string& subject) override {
        const std::scoped_lock lock(subscribing_);
        if (subscriptions_.contains(subject)) return {};
        natsSubscription* subscription = nullptr;
        const natsStatus status =
            natsConnection_Subscribe(&subscription, connection_, subject.c_str(), &Link::came, this);
        if (status != NATS_OK) return textOf(status);
        {
            const std::scoped_lock counting(mutex_);
            if (natsSubscription_SetOnCompleteCB(subscription, &Link::completed, this) == NATS_OK) ++live_;
        }
        natsSubscription_SetPendingLimits(subscription, kPendingMessages, kPendingBytes);
        subscriptions_[subject] = subscription;
        return {};
    }
    void unsubscribe(const std::string& subject) override {
        const std::scoped_lock lock(subscribing_);
        const auto found = subscriptions_.find(subject);
        if (found == subscriptions_.end()) return;
        natsSubscription_Unsubscribe(found->second);
        natsSubscription_Destroy(found->second);
        subscriptions_.erase(found);
    }
    std::string flush(std::chrono::milliseconds maximum) override {
        const natsStatus status = natsConnection_FlushTimeout(connection_, maximum.count());
        return status == NATS_OK ? std::string() : textOf(status);
    }

    std::string streamState(const std::string& stream, NatsStream& into) override {
        Owned<jsStreamInfo, jsStreamInfo_Destroy> info;
        jsErrCode code{};
        const natsStatus status = js_GetStreamInfo(&info.it, jetStream_, stream.c_str(), nullptr, &code);
        into = {};
        if (code == kNoStream) return {};
        if (status == NATS_NOT_FOUND) return {};
        if (status != NATS_OK) return jetStreamText(status);
        into = {true, info.it->State.FirstSeq, info.it->State.LastSeq, info.it->State.Msgs, info.it->State.Bytes};
        return {};
    }
    std::string makeStream(const std::string& stream, const std::string& subject, int copies) override {
        jsStreamConfig config;
        jsStreamConfig_Init(&config);
        const char* subjects[] = {subject.c_str()};
        config.Name = stream.c_str();
        config.Subjects = subjects;
        config.SubjectsLen = 1;
        config.Storage = js_FileStorage;
        config.Replicas = copies;
        config.Discard = js_DiscardNew;  // a full store must not forget how a session began
        jsErrCode code{};
        const natsStatus status = js_AddStream(nullptr, jetStream_, &config, nullptr, &code);
        return status == NATS_OK ? std::string() : jetStreamText(status);
    }
    std::string removeStream(const std::string& stream) override {
        jsErrCode code{};
        const natsStatus status = js_DeleteStream(jetStream_, stream.c_str(), nullptr, &code);
        return status == NATS_OK || code == kNoStream ? std::string() : jetStreamText(status);
    }
    Stored store(const std::string& stream, const std::string& subject, std::span<const std::byte> bytes,
                 std::uint64_t after, std::string& problem) override {
        jsPubOptions options;
        jsPubOptions_Init(&options);
        options.MaxWait = kJetStreamWithin;
        options.ExpectStream = stream.c_str();
        options.ExpectLastSeq = after;
        // Zero means no expectation, and a stream that is empty must stay so until our first message.
        options.ExpectNoMessage = after == 0;
        Owned<jsPubAck, jsPubAck_Destroy> answer;
        jsErrCode code{};
        const natsStatus status = js_Publish(&answer.it, jetStream_, subject.c_str(), bytes.data(),
                                             static_cast<int>(bytes.size()), &options, &code);
        if (status == NATS_OK && answer.it->Sequence == after + 1) return Stored::yes;
        problem = status == NATS_OK ? "another message came between" : jetStreamText(status);
        // Our own message may be there already, if its answer was lost; the caller checks.
        if (code == kLastSequence) return Stored::unknown;
        return code == 0 && status != NATS_OK ? Stored::unknown : Stored::no;
    }
    std::string read(const std::string& stream, const std::string& subject, std::uint64_t first, std::uint64_t last,
                     const Sink& sink) override {
        jsSubOptions options;
        jsSubOptions_Init(&options);
        options.Stream = stream.c_str();
        options.Config.AckPolicy = js_AckNone;
        options.Config.DeliverPolicy = js_DeliverByStartSequence;
        options.Config.OptStartSeq = first;
        Owned<natsSubscription, natsSubscription_Destroy> from;
        jsErrCode code{};
        natsStatus status = js_PullSubscribe(&from.it, jetStream_, subject.c_str(), nullptr, nullptr, &options, &code);
        if (status != NATS_OK) return jetStreamText(status);
        std::string problem;
        for (std::uint64_t next = first; next <= last && problem.empty();) {
            natsMsgList list{};
            status = natsSubscription_Fetch(&list, from.it, kBatch, kJetStreamWithin, &code);
            if (status != NATS_OK) problem = jetStreamText(status);
            if (status == NATS_TIMEOUT && hasAll(from.it)) {  // the last ones were deleted
                problem.clear();
                next = last + 1;
            }
            for (int i = 0; i < list.Count && problem.empty() && next <= last; ++i) {
                const std::uint64_t sequence = sequenceOf(list.Msgs[i]);
                next = sequence + 1;
                if (sequence > last) break;
                if (!sink(sequence, {natsMsg_GetData(list.Msgs[i]),
                                     static_cast<std::size_t>(natsMsg_GetDataLength(list.Msgs[i]))}))
                    problem = "not all of it was read";
            }
            natsMsgList_Destroy(&list);
        }
        natsSubscription_Unsubscribe(from.it);
        return problem;
    }

  private:
    static std::string jetStreamText(natsStatus status) {
        if (status == NATS_NO_RESPONDERS) return "the NATS server has no JetStream (-js), or it has stopped";
        if (status == NATS_TIMEOUT) return "JetStream did not answer in time";
        return textOf(status);
    }
    static bool hasAll(natsSubscription* from) {
        Owned<jsConsumerInfo, jsConsumerInfo_Destroy> info;
        jsErrCode code{};
        return natsSubscription_GetConsumerInfo(&info.it, from, nullptr, &code) == NATS_OK && info.it->NumPending == 0;
    }
    static std::uint64_t sequenceOf(natsMsg* message) {
        Owned<jsMsgMetaData, jsMsgMetaData_Destroy> about;
        return natsMsg_GetMetaData(&about.it, message) == NATS_OK ? about.it->Sequence.Stream : 0;
    }
    static void came(natsConnection*, natsSubscription*, natsMsg* message, void* closure) {
        auto& link = *static_cast<Link*>(closure);
        const auto size = static_cast<std::size_t>(natsMsg_GetDataLength(message));
        {
            const std::scoped_lock lock(link.mutex_);
            if (link.bytes_ + size > link.maxWaiting_) {
                ++link.dropped_;
            } else {
                const char* reply = natsMsg_GetReply(message);
                link.bytes_ += size;
                link.waiting_.push_back(
                    {natsMsg_GetSubject(message), reply ? reply : "", std::string(natsMsg_GetData(message), size)});
                // Only the first message wakes the reader, which takes all.
                if (link.waiting_.size() == 1) (void)::eventfd_write(link.call_, 1);
            }
        }
        natsMsg_Destroy(message);
    }
    static void failed(natsConnection*, natsSubscription*, natsStatus status, void* closure) {
        auto& link = *static_cast<Link*>(closure);
        if (status == NATS_SLOW_CONSUMER) {
            ++link.dropped_;
            return;
        }
        const std::scoped_lock lock(link.mutex_);
        if (link.news_.size() < kMaxNews) link.news_.emplace_back(textOf(status));
    }

    static void completed(void* closure) {
        auto& link = *static_cast<Link*>(closure);
        const std::scoped_lock lock(link.mutex_);
        --link.live_;
        link.ended_.notify_all();
    }
    static void closed(natsConnection*, void* closure) {
        auto& link = *static_cast<Link*>(closure);
        const std::scoped_lock lock(link.mutex_);
        link.closed_ = true;
        link.ended_.notify_all();
    }

    const std::size_t maxWaiting_;
    const int call_;  // eventfd
    natsOptions* options_ = nullptr;
    natsConnection* connection_ = nullptr;
    jsCtx* jetStream_ = nullptr;
    std::atomic<std::uint64_t> dropped_{0};
    mutable std::mutex mutex_;  // guards the members below
    std::deque<NatsMessage> waiting_;
    std::size_t bytes_ = 0;
    std::vector<std::string> news_;
    std::condition_variable ended_;
    int live_ = 0;  // subscriptions whose callbacks may still come
    bool closed_ = false;
    std::mutex subscribing_;  // guards the members below
    std::map<std::string, natsSubscription*> subscriptions_;
};

std::unique_ptr<NatsLink> openNats(const NatsSettings& settings, std::string& problem) {
    auto link = std::make_unique<Link>(settings.maxWaiting);
    problem = link->open(settings);
    if (!problem.empty()) return nullptr;
    return link;
}

}  // namespace

}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) rtsg::OpenNats rtsg_start_nats_3() {
    return &rtsg::openNats;
}

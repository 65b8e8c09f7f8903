// The baseline of mirrors: bare ZeroMQ sockets with messages of the same size.
#include "bench_sync_raw.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <thread>

#include <zmq.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kHead = 40, kPart = std::size_t{256} << 10;  // as the mirror's

/// A ROUTER that has heard of one DEALER.
struct Pair {
    void *server = zmq_ctx_new(), *client = zmq_ctx_new();
    void *router = zmq_socket(server, ZMQ_ROUTER), *dealer = zmq_socket(client, ZMQ_DEALER);
    char identity[64];
    int identitySize = 0;

    explicit Pair(const std::string& endpoint) {
        const int unlimited = 0;
        for (void* socket : {router, dealer}) {
            zmq_setsockopt(socket, ZMQ_SNDHWM, &unlimited, sizeof(unlimited));
            zmq_setsockopt(socket, ZMQ_RCVHWM, &unlimited, sizeof(unlimited));
            zmq_setsockopt(socket, ZMQ_LINGER, &unlimited, sizeof(unlimited));
        }
        zmq_bind(router, endpoint.c_str());
        char bound[256];
        std::size_t length = sizeof(bound);
        zmq_getsockopt(router, ZMQ_LAST_ENDPOINT, bound, &length);
        zmq_connect(dealer, bound);
        zmq_send(dealer, "hi", 2, 0);
        char text[8];
        identitySize = zmq_recv(router, identity, sizeof(identity), 0);
        zmq_recv(router, text, sizeof(text), 0);
    }
    ~Pair() {
        for (void* socket : {router, dealer}) zmq_close(socket);
        zmq_ctx_term(server);
        zmq_ctx_term(client);
    }
    void send(const std::vector<char>& payload) {
        const char head[kHead] = {};
        for (std::size_t at = 0; at < payload.size(); at += kPart) {
            const std::size_t part = std::min(kPart, payload.size() - at);
            char* fresh = static_cast<char*>(std::malloc(part));
            std::memcpy(fresh, payload.data() + at, part);
            zmq_msg_t message;
            zmq_msg_init_data(&message, fresh, part, [](void* data, void*) { std::free(data); }, nullptr);
            zmq_send(router, identity, static_cast<std::size_t>(identitySize), ZMQ_SNDMORE);
            zmq_send(router, head, sizeof(head), ZMQ_SNDMORE);
            zmq_msg_send(&message, router, 0);
        }
    }
    /// Receives one message of `size` bytes; reads every cache line.
    unsigned receive(std::size_t size) {
        unsigned sum = 0;
        for (std::size_t got = 0; got < size;) {
            zmq_msg_t head, body;
            zmq_msg_init(&head);
            zmq_msg_init(&body);
            zmq_msg_recv(&head, dealer, 0);
            zmq_msg_recv(&body, dealer, 0);
            const auto* bytes = static_cast<const unsigned char*>(zmq_msg_data(&body));
            for (std::size_t i = 0; i < zmq_msg_size(&body); i += 64) sum += bytes[i];
            got += zmq_msg_size(&body);
            zmq_msg_close(&head);
            zmq_msg_close(&body);
        }
        return sum;
    }
};

double since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// A SUB socket on a thread of its own, as a process of its own would have it.
class Subscription {
  public:
    explicit Subscription(std::string endpoint) : endpoint_(std::move(endpoint)), thread_([this] { run(); }) {}
    ~Subscription() {
        stop();
        thread_.join();
    }
    void stop() { stop_ = true; }
    int received() const { return received_; }
    std::int64_t receivedAt() const { return at_; }

  private:
    void run() {
        void *context = zmq_ctx_new(), *socket = zmq_socket(context, ZMQ_SUB);
        const int none = 0, wait = 100;
        zmq_setsockopt(socket, ZMQ_RCVHWM, &none, sizeof(none));
        zmq_setsockopt(socket, ZMQ_LINGER, &none, sizeof(none));
        zmq_setsockopt(socket, ZMQ_RCVTIMEO, &wait, sizeof(wait));
        zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "", 0);
        zmq_connect(socket, endpoint_.c_str());
        while (!stop_) {
            zmq_msg_t message;
            zmq_msg_init(&message);
            if (zmq_msg_recv(&message, socket, 0) >= 0) {
                const auto* bytes = static_cast<const unsigned char*>(zmq_msg_data(&message));
                unsigned sum = 0;
                for (std::size_t i = 0; i < zmq_msg_size(&message); i += 64) sum += bytes[i];
                keep(sum);
                at_ = Clock::now().time_since_epoch().count();
                ++received_;
            }
            zmq_msg_close(&message);
        }
        zmq_close(socket);
        zmq_ctx_term(context);
    }
    std::string endpoint_;
    std::atomic<bool> stop_{false};
    std::atomic<int> received_{0};
    std::atomic<std::int64_t> at_{0};
    std::thread thread_;
};

/// Until the n-th has heard `messages[n]` of them; false after a minute.
bool waitForAll(const std::vector<std::unique_ptr<Subscription>>& all, const std::vector<int>& messages) {
    const auto start = Clock::now();
    for (std::size_t k = 0; k < all.size(); ++k)
        while (all[k]->received() < messages[k]) {
            if (since(start) > 60) return false;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    return true;
}

}  // namespace

Delays rawPublishing(std::size_t size, int peers, int messages) {
    void *context = zmq_ctx_new(), *socket = zmq_socket(context, ZMQ_PUB);
    const int none = 0, backlog = 4096;
    zmq_setsockopt(socket, ZMQ_SNDHWM, &none, sizeof(none));
    zmq_setsockopt(socket, ZMQ_LINGER, &none, sizeof(none));
    zmq_setsockopt(socket, ZMQ_BACKLOG, &backlog, sizeof(backlog));
    zmq_bind(socket, "tcp://127.0.0.1:*");
    char bound[256];
    std::size_t length = sizeof(bound);
    zmq_getsockopt(socket, ZMQ_LAST_ENDPOINT, bound, &length);
    Delays result;
    {
        std::vector<std::unique_ptr<Subscription>> all;
        for (int i = 0; i < peers; ++i) all.push_back(std::make_unique<Subscription>(bound));
        const std::vector<char> payload(size, 'x');
        const auto hears = [](const auto& one) { return one->received() > 0; };
        // Subscriptions arrive when they do.
        for (int i = 0; i < 600 && !std::ranges::all_of(all, hears); ++i) {
            zmq_send(socket, payload.data(), payload.size(), 0);
            std::this_thread::sleep_for(std::chrono::milliseconds(100));
        }
        bool good = std::ranges::all_of(all, hears);
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
        const double before = cpuSeconds();
        for (int i = 0; i < messages && good; ++i) {
            std::vector<int> next;
            for (const auto& one : all) next.push_back(one->received() + 1);
            const std::int64_t start = Clock::now().time_since_epoch().count();
            zmq_send(socket, payload.data(), payload.size(), 0);
            good = waitForAll(all, next);
            for (const auto& one : all) result.seconds.push_back(static_cast<double>(one->receivedAt() - start) * 1e-9);
        }
        result.cpuSeconds = (cpuSeconds() - before) / messages / peers;
        if (!good) result.seconds.clear();
        for (const auto& one : all) one->stop();
    }
    zmq_close(socket);
    zmq_ctx_term(context);
    std::ranges::sort(result.seconds);
    return result;
}

double rawThroughput(const std::string& endpoint, std::size_t size, int messages, int underway) {
    Pair pair(endpoint);
    const std::vector<char> payload(size, 'x');
    std::atomic<int> received{0};
    std::atomic<unsigned> sum{0};
    std::thread receiver([&] {
        for (int i = 0; i < messages; ++i) {
            sum += pair.receive(size);
            received = i + 1;
        }
    });
    const auto start = Clock::now();
    for (int i = 0; i < messages; ++i) {
        pair.send(payload);
        while (i - received > underway) std::this_thread::yield();
    }
    receiver.join();
    return double(size) * messages / since(start);
}

std::vector<double> rawLatency(std::size_t size, int messages) {
    Pair pair("tcp://127.0.0.1:*");
    const std::vector<char> payload(size, 'x');
    std::atomic<int> received{0};
    std::thread receiver([&] {
        for (int i = 0; i < messages; ++i) {
            pair.receive(size);
            received = i + 1;
        }
    });
    std::vector<double> times;
    for (int i = 0; i < messages; ++i) {
        const auto start = Clock::now();
        pair.send(payload);
        while (received <= i) std::this_thread::yield();
        times.push_back(since(start) * 1e6);
    }
    receiver.join();
    std::ranges::sort(times);
    return times;
}

}  // namespace rtsg::bench

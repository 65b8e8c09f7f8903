// A client of an MQTT broker, by libmosquitto with a thread of its own.
#include "sockets/mqtt_module.h"

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

#include <mosquitto.h>
#include <mqtt_protocol.h>

namespace rtsg::feeds {

namespace {

constexpr int kKeepAlive = 15;                       // seconds of silence before the broker counts as lost
constexpr auto kPatience = std::chrono::seconds(5);  // for the first answer
constexpr unsigned kLongestPause = 5;                // seconds between attempts

/// The library is begun once for the process.
struct Library {
    Library() { mosquitto_lib_init(); }
    ~Library() { mosquitto_lib_cleanup(); }
    Library(const Library&) = delete;
    Library& operator=(const Library&) = delete;
};

class Mqtt final : public MqttModule {
  public:
    explicit Mqtt(MqttSettings settings) : settings_(std::move(settings)) {}
    ~Mqtt() override {
        if (!client_) return;
        mosquitto_disconnect(client_);
        if (started_) mosquitto_loop_stop(client_, false);
        mosquitto_destroy(client_);
    }
    Mqtt(const Mqtt&) = delete;
    Mqtt& operator=(const Mqtt&) = delete;

    /// The problem, or an empty text.
    std::string start() {
        client_ = mosquitto_new(nullptr, true, this);
        if (!client_) return "no memory for a client";
        mosquitto_int_option(client_, MOSQ_OPT_PROTOCOL_VERSION, MQTT_PROTOCOL_V5);
        mosquitto_int_option(client_, MOSQ_OPT_TCP_NODELAY, 1);
        mosquitto_reconnect_delay_set(client_, 1, kLongestPause, true);
        mosquitto_connect_v5_callback_set(client_,
                                          [](mosquitto*, void* self, int reason, int, const mosquitto_property*) {
                                              static_cast<Mqtt*>(self)->connected(reason);
                                          });
        mosquitto_disconnect_callback_set(
            client_, [](mosquitto*, void* self, int reason) { static_cast<Mqtt*>(self)->disconnected(reason); });
        mosquitto_message_callback_set(client_, [](mosquitto*, void* self, const mosquitto_message* message) {
            static_cast<Mqtt*>(self)->take(*message);
        });
        mosquitto_subscribe_callback_set(client_, [](mosquitto*, void* self, int, int count, const int* granted) {
            static_cast<Mqtt*>(self)->subscribed(count, granted);
        });
        if (const int error = authenticate(); error != MOSQ_ERR_SUCCESS) return textOf(error);
        mosquitto_property* properties = nullptr;
        if (settings_.largest > 0)
            mosquitto_property_add_int32(&properties, MQTT_PROP_MAXIMUM_PACKET_SIZE, settings_.largest);
        const int error =
            mosquitto_connect_bind_v5(client_, settings_.host.c_str(), settings_.port, kKeepAlive, nullptr, properties);
        mosquitto_property_free_all(&properties);
        if (error != MOSQ_ERR_SUCCESS) return textOf(error);
        if (const int failed = mosquitto_loop_start(client_); failed != MOSQ_ERR_SUCCESS) return textOf(failed);
        started_ = true;
        std::unique_lock lock(mutex_);
        if (!answered_.wait_for(lock, kPatience, [this] { return ready_ || !problem_.empty(); }))
            return "the broker does not answer";
        return problem_;
    }

    bool publish(std::string_view message) override {
        return mosquitto_publish(client_, nullptr, settings_.topic.c_str(), static_cast<int>(message.size()),
                                 message.data(), 0, false) == MOSQ_ERR_SUCCESS;
    }

  private:
    static std::string textOf(int error) {
        if (error == MOSQ_ERR_ERRNO) return "no broker there";
        return error == MOSQ_ERR_TLS ? "the broker's certificate or ours is not accepted" : mosquitto_strerror(error);
    }
    int authenticate() {
        const auto text = [](const std::string& value) { return value.empty() ? nullptr : value.c_str(); };
        int error = MOSQ_ERR_SUCCESS;
        if (!settings_.user.empty())
            error = mosquitto_username_pw_set(client_, settings_.user.c_str(), text(settings_.password));
        if (error != MOSQ_ERR_SUCCESS || !settings_.encrypted) return error;
        if (settings_.authorities.empty()) mosquitto_int_option(client_, MOSQ_OPT_TLS_USE_OS_CERTS, 1);
        return mosquitto_tls_set(client_, text(settings_.authorities), nullptr, text(settings_.certificate),
                                 text(settings_.key), nullptr);
    }
    void answer(std::string problem) {
        {
            const std::scoped_lock lock(mutex_);
            ready_ = problem.empty();
            problem_ = std::move(problem);
        }
        answered_.notify_all();
    }
    void connected(int reason) {
        if (reason != MQTT_RC_SUCCESS)
            return answer(std::string("the broker refuses: ") + mosquitto_reason_string(reason));
        if (std::exchange(lost_, false)) settings_.note("the broker is there again");
        if (!settings_.take) return answer({});
        if (const int error = mosquitto_subscribe(client_, nullptr, settings_.topic.c_str(), 0);
            error != MOSQ_ERR_SUCCESS)
            answer(std::string("cannot subscribe: ") + mosquitto_strerror(error));
    }
    void subscribed(int count, const int* granted) {
        constexpr int kRefused = 0x80;
        answer(count > 0 && granted[0] >= kRefused ? "the broker lets nobody subscribe to this topic" : "");
    }
    void disconnected(int reason) {
        if (reason == MOSQ_ERR_SUCCESS || std::exchange(lost_, true)) return;
        settings_.note(std::string("the broker is lost: ") + mosquitto_strerror(reason));
    }
    void take(const mosquitto_message& message) {
        if (message.payloadlen <= 0) return;
        settings_.take({static_cast<const char*>(message.payload), static_cast<std::size_t>(message.payloadlen)});
    }

    MqttSettings settings_;
    mosquitto* client_ = nullptr;
    bool started_ = false;
    bool lost_ = false;  // for the library's thread
    std::mutex mutex_;
    std::condition_variable answered_;
    bool ready_ = false;
    std::string problem_;
};

std::unique_ptr<MqttModule> start(MqttSettings settings, std::string& problem) {
    static const Library library;
    auto client = std::make_unique<Mqtt>(std::move(settings));
    problem = client->start();
    if (!problem.empty()) return nullptr;
    return client;
}

}  // namespace

}  // namespace rtsg::feeds

extern "C" __attribute__((visibility("default"))) rtsg::feeds::StartMqtt rtsg_start_mqtt_2() {
    return rtsg::feeds::start;
}

// Passes messages between a WebSocket and the mirror server.
#include "browser.h"

#include <array>
#include <chrono>
#include <cstring>

namespace rtsg::web {

namespace websocket = beast::websocket;

namespace {

constexpr std::size_t kMaxQueued = std::size_t{80} << 20;  // more than the server sends ahead: nothing is read
constexpr auto kFarewell = std::chrono::seconds(1);
constexpr std::size_t kLongestIncoming = 10 << 10;  // the longest message is a part of a submission
constexpr std::string_view kBye("\x08\0\0\0RTSG\x01\x05\0\0", 12);

/// True if a message has the length of its first part (u32), that part, and perhaps a second one.
bool hasParts(std::string_view message) {
    std::uint32_t first = 0;
    if (message.size() < sizeof(first)) return false;
    std::memcpy(&first, message.data(), sizeof(first));
    return first > 0 && first <= message.size() - sizeof(first);
}

}  // namespace

Browser::Browser(Gateway& gateway, Stream&& stream, std::string source)
    : gateway_(gateway),
      socket_(std::move(stream)),
      farewell_(gateway.io()),
      source_(std::move(source)),
      number_(gateway_.came(this)) {}

Browser::~Browser() {
    leave();
}

void Browser::begin(Request request) {
    request_ = std::move(request);
    socket_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
    socket_.read_message_max(kLongestIncoming);
    socket_.binary(true);
    socket_.auto_fragment(false);
    socket_.control_callback([this](websocket::frame_type kind, beast::string_view) {
        if (kind == websocket::frame_type::close) leaveSoon();
    });
    socket_.async_accept(request_, Ended([self = shared_from_this()](beast::error_code error) {
                             if (error) return self->leave();
                             self->accepted_ = true;
                             self->read();
                             self->write();
                         }));
}

void Browser::read() {
    socket_.async_read(incoming_, Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                           if (error || self->gone_) return self->leave();
                           self->spoke_ = true;
                           const auto bytes = self->incoming_.data();
                           std::string message(static_cast<const char*>(bytes.data()), bytes.size());
                           if (!self->socket_.got_binary() || !hasParts(message)) {
                               ++self->gateway_.refused;
                               self->gateway_.news("ended a browser's connection: its message makes no sense");
                               return self->leave();
                           }
                           self->incoming_.consume(bytes.size());
                           self->waits_ = self;
                           self->gateway_.heard(self->number_, std::move(message));
                       }));
}

void Browser::resume() {
    const std::shared_ptr<Browser> self = std::move(waits_);
    if (!gone_ && !ending_) read();
}

void Browser::push(std::string head, std::span<const std::byte> second, std::shared_ptr<const void> owner) {
    if (gone_ || ending_) return;
    queue_.push_back({std::move(head), second, std::move(owner)});
    queued_ += queue_.back().size();
    if (queued_ > kMaxQueued) return leave();
    write();
}

void Browser::write() {
    if (writing_ || gone_ || !accepted_) return;  // end() may come while the answer is still being written
    if (queue_.empty()) {
        if (!ending_) return;
        writing_ = true;
        socket_.async_close(websocket::close_code::going_away,
                            Ended([self = shared_from_this()](beast::error_code) { self->leave(); }));
        return;
    }
    writing_ = true;
    const Message& message = queue_.front();
    const std::array<net::const_buffer, 2> parts{net::buffer(message.head),
                                                 net::buffer(message.second.data(), message.second.size())};
    socket_.async_write(Parts<net::const_buffer>(parts),
                        Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                            self->writing_ = false;
                            if (error || self->gone_) return self->leave();
                            self->queued_ -= self->queue_.front().size();
                            self->queue_.pop_front();
                            self->write();
                        }));
}

void Browser::end() {
    ending_ = true;
    write();
}

/// Does not wait for a browser that says that it closes and then does not.
void Browser::leaveSoon() {
    farewell_.expires_after(kFarewell);
    farewell_.async_wait([weak = weak_from_this()](beast::error_code error) {
        const std::shared_ptr<Browser> self = weak.lock();
        if (self && !error) self->leave();
    });
}

void Browser::leave() {
    if (std::exchange(gone_, true)) return;
    const std::shared_ptr<Browser> self = std::move(waits_);
    gateway_.heard(number_, std::string(kBye));  // so that the server need not wait for it
    beast::tcp_stream& connection = socket_.next_layer().tcp();
    connection.cancel();
    connection.close();
    gateway_.went(this);
}

}  // namespace rtsg::web

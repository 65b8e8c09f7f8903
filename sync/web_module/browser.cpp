// Passes messages between a WebSocket and the mirror server at the pace of the slower one.
#include "browser.h"

#include <chrono>

namespace rtsg::web {

namespace websocket = beast::websocket;

namespace {

constexpr std::size_t kMaxQueued = std::size_t{1} << 20;
constexpr auto kFarewell = std::chrono::seconds(1);
constexpr std::size_t kLongestIncoming = 10 << 10;  // the longest message is a part of a submission

}  // namespace

Browser::Browser(Gateway& gateway, Stream&& stream, std::string source)
    : gateway_(gateway),
      socket_(std::move(stream)),
      link_(gateway.context(), gateway.settings()),
      descriptor_(gateway.io(), link_.descriptor()),
      farewell_(gateway.io()),
      source_(std::move(source)) {
    gateway_.came(this);
}

Browser::~Browser() {
    leave();
    descriptor_.release();  // it belongs to ZeroMQ
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
                             self->pump();
                         }));
}

void Browser::read() {
    socket_.async_read(
        incoming_, Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
            if (error || self->gone_) return self->leave();
            self->spoke_ = true;
            const auto bytes = self->incoming_.data();
            if (!self->socket_.got_binary() ||
                !self->link_.send({static_cast<const char*>(bytes.data()), bytes.size()})) {
                ++self->gateway_.refused;
                self->gateway_.news("ended a browser's connection: its message makes no sense, or there are too many");
                return self->leave();
            }
            self->incoming_.consume(bytes.size());
            self->pump();  // sending may have lost the notice of incoming messages
            self->read();
        }));
}

void Browser::pump() {
    if (gone_ || !accepted_) return;  // end() may be called while the answer to the browser is still being written
    std::string message;
    while (queued_ < kMaxQueued && link_.receive(message)) {
        queued_ += message.size();
        queue_.push_back(std::move(message));
    }
    write();
    watch();
}

void Browser::watch() {
    if (watching_ || gone_) return;
    watching_ = true;
    descriptor_.async_wait(net::posix::stream_descriptor::wait_read,
                           [self = shared_from_this()](beast::error_code error) {
                               self->watching_ = false;
                               if (!error) self->pump();
                           });
}

void Browser::write() {
    if (writing_ || gone_) return;
    if (queue_.empty()) {
        if (!ending_) return;
        writing_ = true;
        socket_.async_close(websocket::close_code::going_away,
                            Ended([self = shared_from_this()](beast::error_code) { self->leave(); }));
        return;
    }
    writing_ = true;
    socket_.async_write(Parts<net::const_buffer>(net::buffer(queue_.front())),
                        Moved([self = shared_from_this()](beast::error_code error, std::size_t size) {
                            self->writing_ = false;
                            if (error || self->gone_) return self->leave();
                            self->queued_ -= size;
                            self->queue_.pop_front();
                            self->pump();
                        }));
}

void Browser::end() {
    ending_ = true;
    pump();
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
    link_.bye();
    descriptor_.cancel();
    beast::tcp_stream& connection = socket_.next_layer().tcp();
    connection.cancel();
    connection.close();
    gateway_.went(this);
}

}  // namespace rtsg::web

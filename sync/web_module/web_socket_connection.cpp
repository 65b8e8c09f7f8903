// Shakes hands, then passes messages both ways.
#include "web_socket_connection.h"

#include <array>

namespace rtsg::web {

namespace websocket = beast::websocket;

namespace {

constexpr auto kClosesWithin = std::chrono::seconds(1);

}  // namespace

WebSocketConnection::WebSocketConnection(HttpServer& server, std::uint64_t number, Stream&& stream, std::string source)
    : server_(server),
      number_(number),
      source_(std::move(source)),
      socket_(std::move(stream)),
      farewell_(server.io()) {}

void WebSocketConnection::begin(Request request) {
    request_ = std::move(request);
    const HttpServerRules& rules = server_.rules();
    websocket::stream_base::timeout patience{};
    patience.handshake_timeout = rules.requestTimeout;
    patience.idle_timeout = rules.silence;
    patience.keep_alive_pings = true;
    socket_.set_option(patience);
    if (!rules.protocol.empty())
        socket_.set_option(websocket::stream_base::decorator([this](websocket::response_type& response) {
            response.set(http::field::sec_websocket_protocol, server_.rules().protocol);
        }));
    socket_.read_message_max(rules.longestIncoming);
    socket_.auto_fragment(false);
    socket_.control_callback([this](websocket::frame_type kind, beast::string_view) {
        if (kind == websocket::frame_type::close) leaveSoon();
    });
    socket_.async_accept(request_, Ended([self = shared_from_this()](beast::error_code error) {
                             if (self->gone_) return;
                             if (error) {
                                 self->server_.refuse("a handshake failed: " + error.message());
                                 return self->leave();
                             }
                             self->accepted_ = true;
                             self->server_.begun(*self);
                             self->read();
                             self->write();
                         }));
}

void WebSocketConnection::read() {
    socket_.async_read(incoming_, Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                           if (error || self->gone_) return self->leave();
                           self->spoke_ = true;
                           const auto bytes = self->incoming_.data();
                           std::string message(static_cast<const char*>(bytes.data()), bytes.size());
                           self->incoming_.consume(bytes.size());
                           if (!self->server_.heard(*self, std::move(message), self->socket_.got_text())) self->leave();
                       }));
}

void WebSocketConnection::resume() {
    if (!gone_ && !ending_) read();
}

void WebSocketConnection::push(HttpServer::Message message) {
    if (gone_ || ending_) return;
    queue_.push_back(std::move(message));
    write();
}

void WebSocketConnection::write() {
    if (writing_ || gone_ || !accepted_) return;  // end() may come while the answer is still being written
    if (queue_.empty()) {
        if (!ending_) return;
        writing_ = true;
        return socket_.async_close(websocket::close_code::going_away,
                                   Ended([self = shared_from_this()](beast::error_code) { self->leave(); }));
    }
    writing_ = true;
    const HttpServer::Message& message = queue_.front();
    socket_.binary(message.bytes);
    const std::array<net::const_buffer, 2> parts{net::buffer(message.head),
                                                 net::buffer(message.second.data(), message.second.size())};
    socket_.async_write(Parts<net::const_buffer>(parts),
                        Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                            self->writing_ = false;
                            if (error || self->gone_) return self->leave();
                            *self->queued_ -= self->queue_.front().size();
                            self->queue_.pop_front();
                            self->write();
                        }));
}

void WebSocketConnection::end() {
    ending_ = true;
    write();
}

/// Does not wait for a peer that says that it closes and then does not.
void WebSocketConnection::leaveSoon() {
    farewell_.expires_after(kClosesWithin);
    farewell_.async_wait([weak = weak_from_this()](beast::error_code error) {
        const std::shared_ptr<WebSocketConnection> self = weak.lock();
        if (self && !error) self->leave();
    });
}

void WebSocketConnection::leave() {
    if (std::exchange(gone_, true)) return;
    const auto self = shared_from_this();
    farewell_.cancel();
    beast::tcp_stream& connection = socket_.next_layer().tcp();
    connection.cancel();
    connection.close();
    server_.went(*this);
}

}  // namespace rtsg::web

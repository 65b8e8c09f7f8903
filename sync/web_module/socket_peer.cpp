// Reads one client's request, then passes messages both ways.
#include "socket_peer.h"

#include <array>

namespace rtsg::web {

namespace websocket = beast::websocket;

namespace {

constexpr std::size_t kLongestRequest = 8 << 10, kLongestRequestBody = 1 << 10;

}  // namespace

void SocketPeer::begin() {
    parser_.emplace();
    parser_->header_limit(kLongestRequest);
    parser_->body_limit(kLongestRequestBody);
    Stream& stream = socket_.next_layer();
    stream.tcp().expires_after(server_.settings().requestTimeout);
    http::async_read(stream, incoming_, *parser_,
                     Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                         if (self->gone_) return;
                         if (!error) return self->judge(self->parser_->release());
                         if (error != http::error::end_of_stream) self->server_.refused("no request of HTTP/1.1 came");
                         self->leave();
                     }));
}

void SocketPeer::judge(Request request) {
    if (auto refusal = server_.refusal(request)) return refuse(refusal->first, std::move(refusal->second));
    request_ = std::move(request);
    socket_.next_layer().tcp().expires_never();
    websocket::stream_base::timeout patience{};
    patience.handshake_timeout = server_.settings().requestTimeout;
    patience.idle_timeout = server_.settings().silence;
    patience.keep_alive_pings = true;
    socket_.set_option(patience);
    socket_.set_option(websocket::stream_base::decorator([this](websocket::response_type& response) {
        response.set(http::field::sec_websocket_protocol, server_.settings().protocol);
    }));
    socket_.read_message_max(server_.settings().longestIncoming);
    socket_.auto_fragment(false);
    socket_.async_accept(request_, Ended([self = shared_from_this()](beast::error_code error) {
                             if (self->gone_) return;
                             if (error) {
                                 self->server_.refused("a handshake failed: " + error.message());
                                 return self->leave();
                             }
                             self->accepted_ = true;
                             self->server_.came(self->number_, self->queued_);
                             self->read();
                             self->write();
                         }));
}

void SocketPeer::refuse(http::status status, std::string why) {
    server_.refused("refused a request: " + why);
    response_ = {status, 11};
    response_.set(http::field::content_type, "text/plain; charset=utf-8");
    response_.body() = std::move(why) + "\n";
    response_.keep_alive(false);
    response_.prepare_payload();
    http::async_write(socket_.next_layer(), response_,
                      Moved([self = shared_from_this()](beast::error_code, std::size_t) {
                          self->socket_.next_layer().shutdown([self](beast::error_code) { self->leave(); });
                      }));
}

void SocketPeer::read() {
    socket_.async_read(incoming_, Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                           if (error || self->gone_) return self->leave();
                           const auto data = self->incoming_.data();
                           std::string text(static_cast<const char*>(data.data()), data.size());
                           self->incoming_.consume(data.size());
                           using Kind = SocketEvent::Kind;
                           self->server_.heard(self->number_, self->socket_.got_text() ? Kind::text : Kind::bytes,
                                               std::move(text));
                       }));
}

void SocketPeer::resume() {
    if (!gone_ && !ending_) read();
}

void SocketPeer::push(std::string head, std::shared_ptr<const std::string> body, bool bytes) {
    if (gone_ || ending_) return;
    queue_.push_back({std::move(head), std::move(body), bytes});
    write();
}

void SocketPeer::write() {
    if (writing_ || gone_ || !accepted_) return;
    if (queue_.empty()) {
        if (!ending_) return;
        writing_ = true;
        return socket_.async_close(websocket::close_code::going_away,
                                   Ended([self = shared_from_this()](beast::error_code) { self->leave(); }));
    }
    writing_ = true;
    const Message& message = queue_.front();
    socket_.binary(message.bytes);
    const std::array<net::const_buffer, 2> parts{net::buffer(message.head), net::buffer(*message.body)};
    socket_.async_write(Parts<net::const_buffer>(parts),
                        Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                            self->writing_ = false;
                            if (error || self->gone_) return self->leave();
                            *self->queued_ -= self->queue_.front().size();
                            self->queue_.pop_front();
                            self->write();
                        }));
}

void SocketPeer::end() {
    ending_ = true;
    if (!accepted_) return leave();
    write();
}

void SocketPeer::leave() {
    if (std::exchange(gone_, true)) return;
    const auto self = shared_from_this();
    beast::tcp_stream& connection = socket_.next_layer().tcp();
    connection.cancel();
    connection.close();
    server_.went(number_);
}

}  // namespace rtsg::web

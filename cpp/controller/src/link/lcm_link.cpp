#include "quasilpv/lcm_link.hpp"

#include <arpa/inet.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <string>
#include <string_view>

#include "quasilpv/decimal.hpp"
#include "quasilpv/errors.hpp"
#include "quasilpv/realtime.hpp"

namespace quasilpv {
namespace {

constexpr const char* kUrlForm = "udpm://ADDRESS:PORT?ttl=N with a multicast address, 224.0.0.0 to 239.255.255.255";

// A burst of this many packets of one channel is drained without loss.
constexpr int kQueueCapacity = 100;

struct MulticastAddress {
  in_addr group{};
  int port = 0;
  int time_to_live = 0;
};

int parse_bounded(const std::string& digits, int high, const std::string& url, const std::string& field) {
  constexpr std::size_t kMaxDigits = 5;
  const int value = digits.size() <= kMaxDigits ? std::stoi(digits) : high + 1;
  if (value > high) {
    throw InputError("url '" + url + "'", field, quoted(digits), "at most " + std::to_string(high));
  }
  return value;
}

/// Takes `expected` off the front of `text`; false if it does not begin so.
bool take(std::string_view& text, std::string_view expected) {
  const bool begins = text.substr(0, expected.size()) == expected;
  text.remove_prefix(begins ? expected.size() : 0);
  return begins;
}

/// Takes the characters of `allowed` off the front of `text`.
std::string take_all_of(std::string_view& text, std::string_view allowed) {
  const std::string_view taken = text.substr(0, text.find_first_not_of(allowed));
  text.remove_prefix(taken.size());
  return std::string(taken);
}

MulticastAddress parse_url(const std::string& url) {
  constexpr std::string_view kDigits = "0123456789";
  constexpr int kMaxPort = 65535;
  constexpr int kMaxTimeToLive = 255;
  std::string_view rest = url;
  const bool is_multicast_scheme = take(rest, "udpm://");
  const std::string group = take_all_of(rest, "0123456789.");
  const bool has_port = take(rest, ":");
  const std::string port = take_all_of(rest, kDigits);
  const bool has_time_to_live = take(rest, "?ttl=");
  const std::string time_to_live = take_all_of(rest, kDigits);
  MulticastAddress address;
  if (!is_multicast_scheme || !has_port || port.empty() || has_time_to_live == time_to_live.empty() || !rest.empty() ||
      inet_aton(group.c_str(), &address.group) == 0 || !IN_MULTICAST(ntohl(address.group.s_addr))) {
    throw InputError("command line", "url", quoted(url), kUrlForm);
  }
  address.port = parse_bounded(port, kMaxPort, url, "port");
  address.time_to_live = has_time_to_live ? parse_bounded(time_to_live, kMaxTimeToLive, url, "ttl") : 0;
  return address;
}

/// Joins the group and sends one empty datagram as LCM is about to do: LCM itself reports a missing route on several
/// lines of stderr, and only when the first subscription is made.
void require_multicast(const MulticastAddress& address, const std::string& url) {
  const int probe = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const ip_mreq membership{address.group, {INADDR_ANY}};
  const unsigned char time_to_live = 0;
  sockaddr_in target{};
  target.sin_family = AF_INET;
  target.sin_port = htons(static_cast<std::uint16_t>(address.port));
  target.sin_addr = address.group;
  const bool reachable = probe >= 0 &&
                         setsockopt(probe, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof(membership)) == 0 &&
                         setsockopt(probe, IPPROTO_IP, IP_MULTICAST_TTL, &time_to_live, sizeof(time_to_live)) == 0 &&
                         sendto(probe, nullptr, 0, 0, reinterpret_cast<const sockaddr*>(&target), sizeof(target)) == 0;
  const int error = errno;
  if (probe >= 0) {
    close(probe);
  }
  if (!reachable) {
    throw TransportError("url '" + url + "': no multicast (" + std::strerror(error) +
                         "); on one machine: ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo");
  }
}

}  // namespace

void check_lcm_url(const std::string& url) { static_cast<void>(parse_url(url)); }

/// The LCM instance with its subscriptions; lcm.h stays out of the header.
class LcmLink::Connection {
 public:
  Connection(LcmLink& link, const std::string& url) : link_(link), lcm_(lcm_create(url.c_str())) {
    if (lcm_ == nullptr) {
      throw TransportError("url '" + url + "': LCM could not be opened");
    }
  }

  void subscribe(Channel channel) {
    Listener& listener = listeners_[static_cast<std::size_t>(channel)];
    listener = {&link_, channel};
    lcm_subscription_t* subscription = lcm_subscribe(lcm_.get(), channel_name(channel), &Listener::handle, &listener);
    if (subscription == nullptr) {
      throw TransportError(std::string("channel ") + channel_name(channel) + ": LCM could not subscribe");
    }
    lcm_subscription_set_queue_capacity(subscription, kQueueCapacity);
    file_descriptor_ = lcm_get_fileno(lcm_.get());
  }

  bool publish(Channel channel, const void* bytes, std::size_t size) noexcept {
    return lcm_publish(lcm_.get(), channel_name(channel), bytes, static_cast<unsigned int>(size)) == 0;
  }

  bool drain(std::int64_t timeout_ns) noexcept {
    // lcm_handle_timeout() counts in milliseconds, a sample in microseconds.
    pollfd waited{file_descriptor_, POLLIN, 0};
    const timespec timeout{timeout_ns / kNanosecondsPerSecond, timeout_ns % kNanosecondsPerSecond};
    if (ppoll(&waited, 1, &timeout, nullptr) <= 0) {
      return false;
    }
    for (int packet = 0; packet < kQueueCapacity && lcm_handle_timeout(lcm_.get(), 0) > 0; ++packet) {
    }
    return true;
  }

 private:
  struct Listener {
    static void handle(const lcm_recv_buf_t* received, const char* /*channel*/, void* self) {
      const auto* listener = static_cast<const Listener*>(self);
      listener->link->accept(listener->channel, received->data, received->data_size);
    }

    LcmLink* link = nullptr;
    Channel channel = Channel::kEvent;
  };

  struct Destroy {
    void operator()(lcm_t* lcm) const noexcept { lcm_destroy(lcm); }
  };

  LcmLink& link_;
  std::array<Listener, kChannels> listeners_{};
  std::unique_ptr<lcm_t, Destroy> lcm_;
  int file_descriptor_ = -1;
};

LcmLink::LcmLink(Side side, const WireIdentity& identity, const std::string& url, bool allow_network, Listen listen)
    : Link(side, identity) {
  const MulticastAddress address = parse_url(url);
  if (address.time_to_live > 0 && !allow_network) {
    throw InputError("command line", "url", "ttl=" + std::to_string(address.time_to_live),
                     "ttl=0 (this machine only), or --allow-network: without --key messages are not authenticated");
  }
  require_multicast(address, url);
  connection_ = std::make_unique<Connection>(*this, url);
  if (listen == Listen::kPeer) {
    const bool system = identity.is_of_system();
    const Channel measurement = system ? Channel::kSignalsMeasurement : Channel::kMeasurement;
    const Channel command = system ? Channel::kSignalsCommand : Channel::kCommand;
    connection_->subscribe(side == Side::kController ? measurement : command);
    connection_->subscribe(Channel::kEvent);
  }
}

LcmLink::~LcmLink() = default;

bool LcmLink::transmit(Channel channel, const void* bytes, std::size_t size) noexcept {
  return connection_->publish(channel, bytes, size);
}

bool LcmLink::drain(std::int64_t timeout_ns) noexcept { return connection_->drain(timeout_ns); }

}  // namespace quasilpv

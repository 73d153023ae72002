#include "quasilpv/lcm_link.hpp"

#include <arpa/inet.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <regex>
#include <string>

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
    throw InputError("url '" + url + "'", field, digits, "at most " + std::to_string(high));
  }
  return value;
}

MulticastAddress parse_url(const std::string& url) {
  static const std::regex kForm(R"(udpm://([0-9.]+):([0-9]+)(?:\?ttl=([0-9]+))?)");
  constexpr int kMaxPort = 65535;
  constexpr int kMaxTimeToLive = 255;
  std::smatch parts;
  MulticastAddress address;
  if (!std::regex_match(url, parts, kForm) || inet_aton(parts[1].str().c_str(), &address.group) == 0 ||
      !IN_MULTICAST(ntohl(address.group.s_addr))) {
    throw InputError("command line", "url", "'" + url + "'", kUrlForm);
  }
  address.port = parse_bounded(parts[2].str(), kMaxPort, url, "port");
  address.time_to_live = parts[3].matched ? parse_bounded(parts[3].str(), kMaxTimeToLive, url, "ttl") : 0;
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

class LcmLink::Subscription {
 public:
  Subscription(LcmLink& link, Channel channel) : link_(link), channel_(channel) {}

  static void handle(const lcm_recv_buf_t* received, const char* /*channel*/, void* self) {
    const auto* subscription = static_cast<const Subscription*>(self);
    subscription->link_.accept(subscription->channel_, received->data, received->data_size);
  }

 private:
  LcmLink& link_;
  Channel channel_;
};

void LcmLink::Destroy::operator()(_lcm_t* lcm) const noexcept { lcm_destroy(lcm); }

LcmLink::LcmLink(Side side, const WireIdentity& identity, const std::string& url, bool allow_network, Listen listen)
    : Link(side, identity) {
  const MulticastAddress address = parse_url(url);
  if (address.time_to_live > 0 && !allow_network) {
    throw InputError("command line", "url", "ttl=" + std::to_string(address.time_to_live),
                     "ttl=0 (this machine only), or --allow-network: messages are not authenticated");
  }
  require_multicast(address, url);
  lcm_.reset(lcm_create(url.c_str()));
  if (lcm_ == nullptr) {
    throw TransportError("url '" + url + "': LCM could not be opened");
  }
  if (listen == Listen::kPeer) {
    subscribe(side == Side::kController ? Channel::kMeasurement : Channel::kCommand);
    subscribe(Channel::kEvent);
    file_descriptor_ = lcm_get_fileno(lcm_.get());
  }
}

LcmLink::~LcmLink() = default;

void LcmLink::subscribe(Channel channel) {
  auto& slot = subscriptions_[static_cast<std::size_t>(channel)];
  slot = std::make_unique<Subscription>(*this, channel);
  lcm_subscription_t* subscription =
      lcm_subscribe(lcm_.get(), channel_name(channel), &Subscription::handle, slot.get());
  if (subscription == nullptr) {
    throw TransportError(std::string("channel ") + channel_name(channel) + ": LCM could not subscribe");
  }
  lcm_subscription_set_queue_capacity(subscription, kQueueCapacity);
}

bool LcmLink::transmit(Channel channel, const void* bytes, std::size_t size) noexcept {
  return lcm_publish(lcm_.get(), channel_name(channel), bytes, static_cast<unsigned int>(size)) == 0;
}

bool LcmLink::drain(std::int64_t timeout_ns) noexcept {
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

}  // namespace quasilpv

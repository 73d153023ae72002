#include "quasilpv/peer_watch.hpp"

namespace quasilpv {

bool PeerWatch::hears(const Speaker& speaker) noexcept {
  if (is_peer(speaker.sender)) {
    released_ = false;
    if (has_rival_) {
      has_rival_ = false;
      conflict_with(rival_, second_peer());
    }
    return true;
  }
  if (!has_peer_ || released_) {
    if (!fits(speaker)) {
      return false;
    }
    takeovers_ += has_peer_ ? 1 : 0;
    has_peer_ = true;
    peer_ = speaker.sender;
    released_ = has_rival_ = false;
    return true;
  }
  if (pace_ == Pace::kLockStep) {
    conflict_with(speaker, second_peer());
  } else {
    has_rival_ = true;
    rival_ = speaker;
  }
  return false;
}

bool PeerWatch::fits(const Speaker& speaker) noexcept {
  if (side_ == Side::kOperator) {
    return true;
  }
  if (speaker.pace != pace_) {
    conflict_with(speaker, Conflict::kOtherMode);
    return false;
  }
  if (speaker.period_ns != period_ns_) {
    conflict_with(speaker, Conflict::kOtherRate);
    return false;
  }
  return true;
}

void PeerWatch::conflict_with(const Speaker& opponent, Conflict conflict) noexcept {
  if (conflict_ == Conflict::kNone) {
    conflict_ = conflict;
    opponent_ = opponent;
  }
}

}  // namespace quasilpv

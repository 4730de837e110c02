#include "harness/run/schedule.h"

#include <fmt/format.h>

#include <algorithm>

namespace raybench {
namespace {

/// Timing costs what the budget says, with every structure.
std::string LearnsAs(Work work, const std::string& who) {
  return work == Work::kTiming || work == Work::kFirstPasses ? "" : who;
}

}  // namespace

void Schedule::Plan(size_t scene, Work work, const std::string& who, double guess) {
  planned_[scene][{work, who}] += guess;
  costs_.Plan(work, LearnsAs(work, who), guess);
}

void Schedule::Scale(size_t scene, Work work, const std::string& who, double left) {
  const auto found = planned_[scene].find({work, who});
  if (found == planned_[scene].end()) return;
  costs_.Withdraw(work, LearnsAs(work, who), found->second * (1 - left));
  found->second *= left;
}

void Schedule::Forget(size_t scene, const std::string* who) {
  std::erase_if(planned_[scene], [&](const auto& entry) {
    const auto& [work, doer] = entry.first;
    if (who != nullptr && doer != *who) return false;
    costs_.Withdraw(work, LearnsAs(work, doer), entry.second);
    return true;
  });
}

void Schedule::Begin(Work work, std::span<const std::string> who, std::string what) {
  End();
  double guess = 0;
  for (const std::string& doer : who) {
    const auto found = planned_[scene_].find({work, doer});
    if (found == planned_[scene_].end()) continue;
    guess += found->second;
    planned_[scene_].erase(found);
  }
  const std::string learner = who.size() == 1 ? LearnsAs(work, who[0]) : "";
  piece_ =
      Piece{work, learner, std::move(what), guess, costs_.Expect(work, learner, guess), progress_.Elapsed()};
  Update(0);
}

void Schedule::Update(double fraction) {
  const double elapsed = progress_.Elapsed() - piece_->begin;
  // Its parts may differ much, so the finished share counts the more, the larger it is.
  const double expected = std::max(0.0, piece_->expected - elapsed);
  const double rest = fraction > 0 ? elapsed * (1 - fraction) + (1 - fraction) * expected : expected;
  const double others = costs_.Left() - costs_.Expect(piece_->work, piece_->learner, piece_->guess);
  progress_.UpdateLeft(std::max(0.0, others) + rest, fmt::format("{}: {}", scene_name_, piece_->what));
}

void Schedule::End() {
  if (!piece_) return;
  costs_.Finish(piece_->work, piece_->learner, piece_->guess, progress_.Elapsed() - piece_->begin);
  piece_.reset();
}

}  // namespace raybench

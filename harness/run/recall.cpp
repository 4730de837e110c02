#include "harness/run/recall.h"

#include <fmt/format.h>

#include <algorithm>

namespace raybench {
namespace {

Json Kept(const Row& row) {
  Json values = Json::object();
  const Json all = row.ToJson(kCasesColumns);
  for (const auto& [name, value] : all.items())
    if (!value.is_null()) values[name] = value;
  return values;
}

std::string OfBuild(const Entrant& entrant, uint32_t threads) {
  return fmt::format("{}/{}", entrant.Spec(), threads);
}

std::string OfSet(const Entrant& entrant, const PreparedSet& prepared) {
  const RaySet& set = prepared.set;
  return fmt::format("{}/{}/{}/{}", entrant.Spec(), set.Label(), set.order, set.hash);
}

}  // namespace

void Recall::AddPrice(const std::string& spec, double build, double ray) {
  journal_.Add("price", spec, {{"build", build}, {"ray", ray}});
}

bool Recall::Build(Entrant& entrant, uint32_t threads) const {
  const Json& record = journal_.Find("build", OfBuild(entrant, threads));
  if (record.is_null()) return false;
  entrant.build_seconds[threads] = record.at("seconds");
  entrant.build_bytes = std::max(entrant.build_bytes, record.at("bytes").get<uint64_t>());
  entrant.build_values[threads] = Row(record.at("values"), kCasesColumns);
  return true;
}

void Recall::AddBuild(const Entrant& entrant, uint32_t threads) {
  journal_.Add("build", OfBuild(entrant, threads),
               {{"seconds", entrant.build_seconds.at(threads)},
                {"bytes", entrant.build_bytes},
                {"values", Kept(entrant.build_values.at(threads))}});
}

std::optional<std::string> Recall::Tree(Entrant& entrant) const {
  const Json& record = journal_.Find("tree", entrant.Spec());
  if (record.is_null()) return std::nullopt;
  for (auto& [threads, values] : entrant.build_values)
    values = Row(record.at("values").at(std::to_string(threads)), kCasesColumns);
  return record.at("flaw").get<std::string>();
}

void Recall::AddTree(const Entrant& entrant, const std::string& flaw) {
  Json values = Json::object();
  for (const auto& [threads, row] : entrant.build_values) values[std::to_string(threads)] = Kept(row);
  journal_.Add("tree", entrant.Spec(), {{"flaw", flaw}, {"values", values}});
}

std::optional<std::string> Recall::Check(Entrant& entrant, size_t set, const PreparedSet& prepared) const {
  const Json& record = journal_.Find("check", OfSet(entrant, prepared));
  if (record.is_null()) return std::nullopt;
  entrant.set_values[set] = Row(record.at("values"), kCasesColumns);
  return record.at("flaw").get<std::string>();
}

bool Recall::IsChecked(const Entrant& entrant, const PreparedSet& prepared) const {
  return !journal_.Find("check", OfSet(entrant, prepared)).is_null();
}

void Recall::AddCheck(const Entrant& entrant, size_t set, const PreparedSet& prepared,
                      const std::string& flaw) {
  journal_.Add("check", OfSet(entrant, prepared),
               {{"flaw", flaw}, {"values", Kept(entrant.set_values[set])}});
}

std::optional<KeptPlan> Recall::Plan(const std::string& key) const {
  const Json& record = journal_.Find("plan", key);
  if (record.is_null()) return std::nullopt;
  return KeptPlan{.step = record.at("step"),
                  .samples = {.passes = record.at("passes"),
                              .warm_up = record.at("warm_up"),
                              .samples = record.at("samples"),
                              .sample_cost = record.at("sample_cost")},
                  .cold = record.at("cold")};
}

void Recall::AddPlan(const std::string& key, const KeptPlan& plan) {
  journal_.Add("plan", key,
               {{"step", plan.step},
                {"passes", plan.samples.passes},
                {"warm_up", plan.samples.warm_up},
                {"samples", plan.samples.samples},
                {"sample_cost", plan.samples.sample_cost},
                {"cold", plan.cold}});
}

std::optional<uint32_t> Recall::Step(const std::string& key) const {
  const Json& record = journal_.Find("step", key);
  return record.is_null() ? std::nullopt : std::optional(record.at("step").get<uint32_t>());
}

void Recall::AddSample(const std::string& key, Sample sample) {
  sample.process = process_;
  journal_.AddSample(key, sample);
}

uint32_t Recall::Missing(const std::string& key, const KeptPlan& plan) const {
  const std::vector<Sample> samples = Samples(key);
  const auto own =
      std::count_if(samples.begin(), samples.end(), [&](const Sample& s) { return s.process == process_; });
  return plan.samples.samples - uint32_t(std::min<int64_t>(own, plan.samples.samples));
}

}  // namespace raybench

// Rules for keyframes that cannot be kept are refused where they are set.
#include "oriel/window/keyframe_policy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace oriel {
namespace {

// W11
TEST(KeyframePolicy, RefusesRulesThatCannotBeKept) {
  using Spoil = std::function<void(KeyframeRules&)>;
  const std::pair<const char*, Spoil> cases[] = {
      {"max_keyframes = 0", [](KeyframeRules& r) { r.max_keyframes = 0; }},
      {"lag = -1", [](KeyframeRules& r) { r.lag = -1; }},
      {"an interval of -5 ns", [](KeyframeRules& r) { r.interval = Duration{-5}; }},
      {"parallax", [](KeyframeRules& r) { r.parallax = -0.1; }},
      {"parallax", [](KeyframeRules& r) { r.parallax = std::nan(""); }},
      {"least_shared", [](KeyframeRules& r) { r.least_shared = 1.5; }},
      {"least_shared", [](KeyframeRules& r) { r.least_shared = std::nan(""); }}};
  KeyframePolicy policy(ProviderId{0}, nullptr);
  for (const auto& [word, spoil] : cases) {
    KeyframeRules rules;
    ASSERT_TRUE(policy.set(rules).ok());
    spoil(rules);
    const Result<void> refused = policy.set(rules);
    ASSERT_FALSE(refused.ok()) << word;
    EXPECT_EQ(refused.error().code, ErrorCode::bad_input);
    EXPECT_NE(refused.error().message.find(word), std::string::npos) << refused.error();
    EXPECT_THROW(KeyframePolicy(ProviderId{0}, nullptr, rules), ContractViolation);
  }
}

}  // namespace
}  // namespace oriel

// The table of a run's settings: read, checked and printed by it. Private to run_config*.cc.
#pragma once
#include <vector>

#include "oriel/io/run_config.h"

namespace oriel::io_detail {

struct ConfigKey {
  const char* section;  // empty: top
  const char* name;
  setting::Kind kind;  // of a RunConfig
  const char* unit;
  const char* sentence;
  bool required = false;
};
// All but those of parts and of tasks of one's own. What may be named is `names`' to say.
std::vector<ConfigKey> run_config_keys(const RunNames& names = shipped_names());

// Sets a setting in its options; what was expected where the text is none: "a number from 0 to 1".
std::string set_setting(const setting::Kind& kind, void* options, const std::string& text,
                        const NameTable<NamedLoss>& losses);
// Its value as YAML, such that it can be set again.
std::string setting_text(const setting::Kind& kind, void* options, const NameTable<NamedLoss>& losses);
// What it is, for people: sentence, words, unit.
std::string setting_comment(const setting::Kind& kind, const std::string& unit, const std::string& sentence);

}  // namespace oriel::io_detail

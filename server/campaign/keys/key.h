#pragma once
// What a key of the campaign file holds. The reader takes forms, units, ranges and words from here,
// and so do the JSON Schema and the reference of keys: none of them can say anything else.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/campaign/model/range.h"
#include "server/campaign/model/word_table.h"

namespace calib::campaign {

/// What may stand at a key.
struct Form {
  enum class Kind {
    kText,
    kNumber,       ///< with a unit behind it, or in SI
    kWhole,        ///< a whole number from `least` to `most`
    kWord,         ///< one of `words`
    kTrueOrFalse,  ///< true, false
    kNothing,      ///< `NAME:` alone
    kList,         ///< of `of[0]`
    kMap,          ///< the keys of `section`
    kAnyOf,        ///< one of `of`
  };
  Kind kind = Kind::kText;
  std::string unit = {};                ///< kNumber: SI; empty: unit and range are the catalogue's
  Range range = {};                     ///< kNumber, in that unit
  std::int64_t least = 0;               ///< kWhole
  std::uint64_t most = 0;               ///< kWhole
  std::vector<std::string> words = {};  ///< kWord
  std::string section = {};             ///< kMap
  std::vector<Form> of = {};
};

Form Text();
Form Number(std::string unit, Range range = {});
/// A number whose unit and range the catalogue says.
Form NumberOfCatalogue();
Form Whole(std::int64_t least, std::uint64_t most);
/// A whole number that a generator of random numbers begins with.
Form Seed();
Form OneWord(std::vector<std::string> words);
template <typename Enum, std::size_t N>
Form OneWord(const WordTable<Enum, N>& words) {
  return OneWord(AllWords(words));
}
Form TrueOrFalse();
Form Nothing();
Form ListOf(Form form);
/// A list; what stands alone is a list of one.
Form OneOrMore(Form form);
Form MapOf(std::string section);
Form AnyOf(std::vector<Form> forms);

/// The form of this kind that may stand at a key or in its list; nullptr: none.
const Form* FindForm(const Form& form, Form::Kind kind);

/// What stands for the default of a key that has to be there.
inline constexpr const char* kRequired = "required";

struct Key {
  std::string name;
  Form form;
  std::string standard;  ///< where the key is absent; kRequired: it has to be there; empty: nothing
  std::string meaning;
  std::string values = {};  ///< in people's words, where the form does not say it
};

/// A name that the keys of a section can be, of what this build offers.
struct Offered {
  std::string name;
  std::string meaning;
};

/// The keys of one map.
struct Section {
  std::string name;
  std::string title;      ///< where it stands, as people write it: "experiments[].packing"
  std::vector<Key> keys;  ///< one in capitals (NAME, PIECE) stands for every other key
  std::vector<Offered> offered = {};
  bool closed = false;                ///< the one in capitals stands for what is offered alone
  std::vector<Section> of_keys = {};  ///< that its own keys alone speak of
};

/// The row of a key, that in capitals included; nullptr: the map has no such key.
const Key* FindKey(const Section& section, std::string_view name);
/// Whether it stands for names that the user or the catalogue gives.
bool IsPlaceholder(const Key& key);

}  // namespace calib::campaign

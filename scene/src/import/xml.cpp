// Tether: XML elements with checked attributes. SPDX-License-Identifier: BSD-3-Clause
#include "xml.hpp"
#include "bounds.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "geometry/surface_files.hpp"

namespace tether::scene::import {

namespace {

/// -1: all of it is UTF-8 without a zero; else the place of the first byte that is not.
long bad_byte(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t size = files::character_at(text.substr(i));
    if (size == 0 || text[i] == '\0') return static_cast<long>(i);
    i += size;
  }
  return -1;
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

/// Whole words only, the same in every locale.
std::optional<double> read_number(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) return {};
  return value;
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> out;
  for (std::size_t i = 0; i < text.size();) {
    while (i < text.size() && is_space(text[i])) ++i;
    std::size_t end = i;
    while (end < text.size() && !is_space(text[end])) ++end;
    if (end > i) out.push_back(text.substr(i, end - i));
    i = end;
  }
  return out;
}

std::string shortened(std::string_view text) {
  if (text.size() <= kLongestShown) return fmt::format("\"{}\"", text);
  std::size_t end = 0;  // no sequence is cut
  while (end < kLongestShown)
    end += std::max<std::size_t>(1, files::character_at(text.substr(end)));
  return fmt::format("\"{}...\"", text.substr(0, end));
}

/// The place of the first element with more than kMostAttributes; npos: none has.
std::size_t crowded(std::string_view text) {
  for (std::size_t at = text.find('<'); at != std::string_view::npos; at = text.find('<', at)) {
    const std::string_view rest = text.substr(at);
    const auto behind = [&](std::string_view end) {
      const std::size_t found = rest.find(end);
      return found == std::string_view::npos ? text.size() : at + found + end.size();
    };
    if (rest.substr(0, 4) == "<!--" || rest.substr(0, 9) == "<![CDATA[" ||
        rest.substr(0, 2) == "<?") {
      at = behind(rest[1] == '?' ? "?>" : rest[2] == '-' ? "-->" : "]]>");
      continue;
    }
    char quote = 0;
    std::size_t count = 0, k = at + 1;
    for (; k < text.size() && (quote != 0 || text[k] != '>'); ++k) {
      if (quote != 0) {
        if (text[k] == quote) quote = 0;
      } else if (text[k] == '"' || text[k] == '\'') {
        quote = text[k];
        if (++count > kMostAttributes) return at;
      }
    }
    at = k;
  }
  return std::string_view::npos;
}

/// Refuses what tinyxml2 takes and XML does not, and names without end.
class Inspection : public tinyxml2::XMLVisitor {
 public:
  explicit Inspection(Problems& problems) : problems_(problems) {}
  bool VisitEnter(const Node& node, const tinyxml2::XMLAttribute* first) override {
    bound(node.GetLineNum(), node.Name());
    for (const auto* each = first; each != nullptr; each = each->Next()) {
      bound(each->GetLineNum(), each->Name());
      const std::string_view name = each->Name();
      if (name == "name" || name == "class" || name == "childclass")
        bound(each->GetLineNum(), each->Value());
      if (bad_byte(each->Value()) >= 0 || bad_byte(each->Name()) >= 0)
        problems_.add(each->GetLineNum(), path(node), "",
                      "a character reference names no character");
    }
    return true;
  }
  bool Visit(const tinyxml2::XMLUnknown& unknown) override {
    problems_.add(unknown.GetLineNum(), "", "",
                  "DOCTYPE and entities are not read; write what they stand for");
    return true;
  }

 private:
  void bound(int line, std::string_view name) {
    if (name.size() > kLongestName)
      problems_.add(line, "", shortened(name),
                    fmt::format("a name has at most {} bytes", kLongestName));
  }

  Problems& problems_;
};

}  // namespace

Document::Document(std::string_view text, Problems& problems) {
  const auto line_of = [&](std::size_t place) {
    const auto begin = text.begin();
    return 1 +
           static_cast<int>(std::count(begin, begin + static_cast<std::ptrdiff_t>(place), '\n'));
  };
  if (text.size() > kLargestPart) problems.add(1, "", "", "must be a file of at most 64 MiB");
  if (const long bad = problems.clean() ? bad_byte(text) : -1; bad >= 0)
    problems.add(line_of(static_cast<std::size_t>(bad)), "", "",
                 "is not UTF-8: an XML file in another encoding, or no XML at all");
  problems.finish();
  if (const std::size_t at = crowded(text); at != std::string_view::npos)
    problems.add(line_of(at), "", "",
                 fmt::format("an element has at most {} attributes", kMostAttributes));
  problems.finish();
  if (xml_.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    std::string why = tinyxml2::XMLDocument::ErrorIDToName(xml_.ErrorID());
    if (xml_.ErrorID() == tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED)
      why = fmt::format("more than {} elements inside each other", TINYXML2_MAX_ELEMENT_DEPTH);
    if (xml_.ErrorID() == tinyxml2::XML_ERROR_EMPTY_DOCUMENT) why = "it is empty";
    problems.add(std::max(1, xml_.ErrorLineNum()), "", "", "is not XML that can be read: " + why);
  } else if (xml_.RootElement() == nullptr) {
    problems.add(1, "", "", "has no element");
  } else {
    Inspection inspection(problems);
    xml_.Accept(&inspection);
    if (const Node* second = xml_.RootElement()->NextSiblingElement(); second != nullptr)
      problems.add(*second, "", "a document has one root element");
  }
  problems.finish();
}

struct Document::Included {
  std::set<std::string> files;
  std::size_t bytes = 0;
};

void Document::include_files(Problems& problems) {
  Included so_far;
  include_files(*xml_.RootElement(), 1, so_far, problems);
  problems.finish();
}

// As in MuJoCo files are seen from the folder of the first one, and none is included twice.
void Document::include_files(Node& parent, int depth, Included& so_far, Problems& problems) {
  if (depth > static_cast<int>(TINYXML2_MAX_ELEMENT_DEPTH))
    return problems.add(parent, "",
                        fmt::format("with the files that are included, more than {} elements are "
                                    "inside each other",
                                    TINYXML2_MAX_ELEMENT_DEPTH));
  for (Node* each = parent.FirstChildElement(); each != nullptr && problems.clean();) {
    if (!is(*each, "include")) {
      include_files(*each, depth + 1, so_far, problems);
      each = each->NextSiblingElement();
      continue;
    }
    Tag tag(*each, problems);
    const std::string name = tag.text("file");
    try {
      std::string place;
      const std::string text = read_beside(problems.file(), name, place, problems.folder());
      so_far.bytes += text.size();
      if (!so_far.files.insert(place).second) throw SurfaceError("is included twice");
      if (so_far.bytes > kLargestPart)
        throw SurfaceError("is one of files that have more than 64 MiB together");
      Problems of_file(name, problems.folder());
      const Document other(text, of_file);
      tinyxml2::XMLNode* last = each;
      for (const Node* part : elements(other.root()))
        last = parent.InsertAfterChild(last, part->DeepClone(&xml_));
    } catch (const SurfaceError& e) {
      tag.wrong("file", e.what());
    }
    Node* const included = each;
    each = each->NextSiblingElement();
    parent.DeleteChild(included);
  }
}

std::string path(const Node& node) {
  const char* const name = node.Attribute("name");
  if (name != nullptr) return fmt::format("{} {}", node.Name(), shortened(name));
  const tinyxml2::XMLNode* const parent = node.Parent();
  const Node* const above = parent != nullptr ? parent->ToElement() : nullptr;
  if (above == nullptr || above->Parent() == nullptr || above->Parent()->ToElement() == nullptr)
    return node.Name();  // the root is in every path
  return path(*above) + ": " + node.Name();
}

std::string name_or_line(const Node& node) {
  const char* const name = node.Attribute("name");
  return name != nullptr && *name != '\0' ? name : fmt::format("line {}", node.GetLineNum());
}

bool is(const Node& node, std::string_view name) { return node.Name() == name; }

std::vector<const Node*> elements(const Node& node, const char* name) {
  std::vector<const Node*> out;
  for (const Node* each = node.FirstChildElement(name); each != nullptr;
       each = each->NextSiblingElement(name))
    out.push_back(each);
  return out;
}

std::string shown(const std::string& text) {
  Problem problem;  // whose message goes to terminals
  problem.allowed = text;
  return problem.message().substr(2);
}

std::string Tag::name(std::string_view key, std::string_view allowed) {
  const char* const found = find(key);
  if (found == nullptr) {
    missing(key, std::string(allowed));
    return "";
  }
  if (*found == '\0' || !files::is_name(found))
    wrong(key, std::string("must be a name: it ") + files::kName);
  return found;
}

std::vector<double> Tag::numbers(std::string_view key, std::size_t least, std::size_t most) {
  const char* const found = find(key);
  if (found == nullptr) return {};
  const std::vector<std::string_view> words = words_of(found);
  std::vector<double> out;
  for (const std::string_view word : words) {
    const std::optional<double> value = out.size() < most ? read_number(word) : std::nullopt;
    if (!value) break;
    out.push_back(*value);
  }
  if (out.size() == words.size() && out.size() >= least) return out;
  wrong(key, least < most ? fmt::format("must be {} to {} finite numbers", least, most)
             : most == 1  ? "must be a finite number"
                          : fmt::format("must be {} finite numbers", most));
  return {};
}

void Tag::wrong(std::string_view key, std::string allowed) {
  const char* const found = find(key);
  problems_.add(line(), path(node_) + ": " + std::string(key),
                found != nullptr ? shortened(found) : "", std::move(allowed));
}

void Tag::finish(Remarks& remarks, const std::set<std::string, std::less<>>& no_matter) {
  const auto name_unread = [&](std::string_view key) {
    if (keys_read_.count(key) == 0 && no_matter.count(key) == 0)
      remarks.add(fmt::format("attribute {} of <{}>", key, node_.Name()), name_or_line(node_));
  };
  for (const auto* each = node_.FirstAttribute(); each != nullptr; each = each->Next())
    name_unread(each->Name());
  if (defaults_ == nullptr) return;
  for (const auto& [key, value] : *defaults_)
    if (node_.Attribute(key.c_str()) == nullptr) name_unread(key);
}

}  // namespace tether::scene::import

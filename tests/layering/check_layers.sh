#!/usr/bin/env bash
# Holds the #include lines of the tree against the table of who may know whom (deploy and README: architecture).
# usage: check_layers.sh ROOT. One line per wrong arrow; exit 1 if there is any. The longest matching folder, or file, wins.
set -euo pipefail
root=${1:?usage: check_layers.sh ROOT}
cd "$root"

# folder | own headers it may include (prefixes) | libraries it may include (regular expression; - for none of the watched)
table='
dem/catalog       dem/                                                                -
dem               dem/                                                                -
inference         inference/                                                          -
proto/rpc         proto/rpc/,calib/v1/                                                grpcpp|chrono
worker            worker/,dem/,proto/rpc/,calib/v1/                                   grpcpp|spdlog|chrono|CLI
server/campaign   server/campaign/,dem/,inference/                                    -
server/campaign/model      server/campaign/model/,dem/,inference/                     -
server/campaign/file/text  server/campaign/file/text/                                 yaml-cpp
server/store      server/store/,server/campaign/model/                                SQLiteCpp|sqlite3|chrono|spdlog
server/messages   server/messages/,server/campaign/,dem/,calib/v1/                    chrono
server/scheduler  server/scheduler/,server/messages/,server/store/,server/campaign/,inference/,dem/,calib/v1/   chrono|spdlog|nlohmann
server/report     server/report/,server/messages/,server/campaign/,inference/,dem/catalog/,dem/formula/,calib/v1/   nlohmann|chrono
server/service    server/service/,server/messages/,server/scheduler/,server/store/,server/campaign/,inference/,dem/,proto/rpc/,calib/v1/  grpcpp|spdlog|chrono|nlohmann
server/client     server/client/,server/report/,server/messages/,server/campaign/,inference/,proto/rpc/,calib/v1/          grpcpp|chrono
server/client/session.cc  server/client/,server/service/,server/messages/,proto/rpc/,calib/v1/                       grpcpp|chrono
server/diagnosis  server/diagnosis/,server/client/,server/report/,server/campaign/,inference/,dem/catalog/,dem/formula/,dem/simulation/,calib/v1/   nlohmann
server/ctl        server/ctl/,server/diagnosis/,server/client/,server/report/,server/messages/,server/campaign/,proto/rpc/,calib/v1/,dem/catalog/,dem/formula/,dem/simulation/,inference/  CLI|nlohmann|chrono
server            server/service/,server/store/,server/scheduler/,proto/rpc/address.h                     spdlog|CLI|chrono
'
watched='grpcpp|SQLiteCpp|sqlite3|yaml-cpp|spdlog|CLI|nlohmann|chrono'

include='include[[:space:]]*["<]([^">]+)[">]'
wrong=0
while IFS=: read -r file line text; do
  [[ $text =~ $include ]] || continue
  header=${BASH_REMATCH[1]}
  [ "$header" != calib/return_if_error.h ] || continue  # the whole tree's
  best='' own='' libraries=''
  while read -r folder may_own may_libraries; do
    [ -n "$folder" ] || continue
    if [[ ($file == "$folder"/* || $file == "$folder") && ${#folder} -gt ${#best} ]]; then best=$folder own=$may_own libraries=$may_libraries; fi
  done <<<"$table"
  [ -n "$best" ] || continue
  if [[ $header =~ ^(dem|inference|server|worker|proto|calib)/ ]]; then
    allowed=no
    IFS=, read -ra prefixes <<<"$own"
    for prefix in "${prefixes[@]}"; do [[ $header == "$prefix"* ]] && allowed=yes; done
    [ $allowed = yes ] || { echo "$file:$line: $best may not include $header (allowed: $own)"; wrong=1; }
  elif [[ $header =~ ^($watched)(/|\.|$) && ( $libraries = - || ! $header =~ ^($libraries)(/|\.|$) ) ]]; then
    echo "$file:$line: $best may not include <$header>"; wrong=1
  fi
done < <(grep -rnE '^[[:space:]]*#[[:space:]]*include' --include='*.h' --include='*.cc' dem inference proto server worker 2>/dev/null)

# The libraries without a machine around them: no environment, no clock, no output.
if grep -rnE '\b(std::)?(getenv|cout|cerr|clock_gettime|gettimeofday)\b' --include='*.h' --include='*.cc' dem inference; then
  echo 'dem and inference know no environment, no clock and no terminal'; wrong=1
fi

# libm chooses its code by the processor and gives other bits on another: dem has functions of its own (dem/elementary). sqrt,
# rounding and remainders are exact everywhere. Words in comments and texts do not count.
libm='exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot|sin|cos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|asinh|acosh|atanh|erf|erfc|tgamma|lgamma|beta|fma'
for file in $(grep -rlE "\b($libm)[fl]? *\(|std::($libm)\b" --include='*.h' --include='*.cc' dem | sort); do
  if sed -E 's/"([^"\\]|\\.)*"//g; s|//.*||' "$file" | grep -nE "\bstd::($libm)[fl]?\b|(^|[^_.>:[:alnum:]])($libm)[fl]? *\(" | sed "s|^|$file:|"; then
    echo "dem may not call libm's transcendental functions: other processors would give other bits (dem/elementary)"; wrong=1
  fi
done
exit $wrong

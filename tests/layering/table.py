"""Who may know whom: the table that check_layers.py holds the tree against. Edit here when a folder comes, goes or moves."""

# One line per part of the tree, its folders from the ground up: a folder includes its own files, and those of folders to its
# left. Folders in one pair of braces do not know each other. A folder in no line is an error.
ORDER = """
dem        elementary < geometry < particles < model < contact < contact/laws < effects/shared < effects < formula < neighbor
           < dynamics < measure < measure/observables < lab_tests/shared < lab_tests < registry < simulate
inference  numerics < sampling < prior < data < mixture < scatter < evidence < filter < tmcmc < surrogate < emulator
           < { diagnosis discrepancy prediction sensitivity } < adaptive
proto      calib/v1 < rpc
worker     program < engine < .
server     { campaign/model campaign/file/text access } < campaign/keys < campaign/checks < { campaign/file/parameters campaign/file/shared } < campaign/file/program < campaign/file < messages < { store report/text } < planning < planning/phases
           < methods/iterative_bayesian_filter < { methods/adaptive_emulator methods/sqmc methods/tmcmc methods/surrogate_msrs methods/table methods/design } < methods
           < { scheduler/leases report/views } < scheduler < service/upkeep < { service report/documents } < client < { page diagnosis inspection } < { ctl/shell ctl/slurm } < ctl < ctl/verbs < .
"""

# What a folder may include of other parts (prefixes), and which of the watched libraries. The longest row that fits counts;
# ORDER holds inside a part as well.
CAMPAIGN_OF_DEM = 'dem/elementary dem/geometry dem/particles dem/model dem/formula dem/neighbor dem/registry'
ASKING_OF_DEM = 'dem/model dem/formula dem/registry'
METHODS = 'server/methods/registry.h'  # all that anybody else knows of them
KNOWS = f"""
dem               |                                                                        |
inference         |                                                                        |
proto/calib/v1    |                                                                        |
proto/rpc         | proto/calib                                                            | grpcpp chrono openssl
worker            | dem proto                                                              | grpcpp spdlog chrono CLI nlohmann
worker/engine     | dem proto worker/program                                                       | chrono spdlog
worker/program    | proto                                                                  | chrono
server/campaign   | {CAMPAIGN_OF_DEM} inference                                            | openssl
server/access     |                                                                        | openssl spdlog
server/campaign/file/text |                                                                | yaml-cpp
server/campaign/file/program | {CAMPAIGN_OF_DEM} inference server/campaign                                  | nlohmann
server/messages   | dem proto/calib proto/rpc server/campaign                              | chrono nlohmann
server/store      | server/campaign/model                                                  | SQLiteCpp sqlite3 chrono spdlog
server/planning   | dem inference proto/calib server/campaign server/messages server/store | nlohmann
server/methods    | inference server/campaign server/planning                              | nlohmann
server/scheduler  | dem inference proto/calib server/campaign server/messages server/store server/planning {METHODS} | chrono spdlog nlohmann
server/service    | dem inference proto server/campaign server/access server/messages server/store server/planning {METHODS} server/scheduler | grpcpp spdlog chrono nlohmann
server            | proto/rpc server/messages server/store server/scheduler server/service server/client server/page | spdlog CLI chrono
server/report     | {ASKING_OF_DEM} inference proto/calib server/campaign server/messages {METHODS} | nlohmann chrono
server/client     | inference proto server/campaign server/access server/messages server/report {METHODS} | grpcpp nlohmann chrono
server/client/session | proto server/access server/messages server/service server/client               | grpcpp chrono
server/page       | proto/calib proto/rpc server/access server/messages server/report server/client | openssl nlohmann chrono
server/diagnosis  | {ASKING_OF_DEM} dem/simulate inference proto/calib server/campaign server/messages server/report server/client {METHODS} | nlohmann
server/inspection | dem/registry server/campaign {METHODS} | nlohmann
server/ctl        | {ASKING_OF_DEM} dem/simulate inference proto server/campaign server/access server/messages server/report server/client server/page server/diagnosis server/inspection {METHODS} | CLI nlohmann chrono
"""
# Methods are named in their rooms alone: the folders of ROOMS, where their names are no common words. The word of where a posterior
# comes from is one of them.
ROOMS, COMMON_WORDS, MAY_NAME_THEM = 'server/methods', 'table design', 'server/campaign/model/words.h'
WATCHED = 'grpcpp openssl SQLiteCpp sqlite3 yaml-cpp spdlog CLI nlohmann chrono'

# Folders with one file per name, or which another plan rebuilds, may hold more than MOST_FILES (.h and .cc of one name count one).
MOST_FILES = 25
MAY_HOLD_MORE = 'server/diagnosis server/ctl/verbs server/store/migrations dem/effects dem/contact/laws dem/lab_tests dem/measure/observables'

# Doors: a README.md each; * stands for every folder directly inside.
DOORS = '. proto server worker tests dem/* inference/* server/* tests/*'
MOST_README_LINES = 60
MOST_README_LINES_AT_ROOT = 120
MOST_COLUMNS = 100
MOST_COLUMNS_OF_A_ROW = 160  # rows of a table, and lines that are one link
# All Markdown but rows of tables, fenced code and files that say in their first lines that they are generated.
MOST_WORDS = 25000

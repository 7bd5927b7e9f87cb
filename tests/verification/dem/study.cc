// Runs one known case and prints its curve as CSV: dem_study PACKING CONTACT TEST PRESSURE
// key=value ... path=FILE
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include "dem/catalog/catalog.h"
#include "dem/simulation/scenario.h"
using namespace calib::dem;
int main(int argc, char** argv) {
  Scenario s;
  s.model.density = 2650e3;
  s.staging = {.rate = 0.1,
               .step = 0.002,
               .damping_loading = 0.2,
               .damping_settling = 0.9,
               .unbalanced = 5e-4};
  std::ifstream f(argv[1]);
  std::stringstream t;
  t << f.rdbuf();
  std::vector<PackingProblem> pr;
  s.packing = ParsePacking(t.str(), pr);
  if (!pr.empty()) {
    puts(pr[0].message.c_str());
    return 1;
  }
  s.model.contact = argv[2];
  s.test = argv[3];
  s.settings["confining_pressure"] = atof(argv[4]);
  double to = 0.2, by = 0.002;
  std::string path;
  for (int a = 5; a < argc; ++a) {
    std::string kv = argv[a];
    auto e = kv.find('=');
    std::string k = kv.substr(0, e), v = kv.substr(e + 1);
    if (k == "to")
      to = atof(v.c_str());
    else if (k == "by")
      by = atof(v.c_str());
    else if (k == "path")
      path = v;
    else if (k == "threads")
      s.threads = atoi(v.c_str());
    else if (k == "density")
      s.model.density = atof(v.c_str());
    else if (k == "rate") {
      if (v == "auto")
        s.staging.rate.reset();
      else
        s.staging.rate = atof(v.c_str());
    } else if (k == "unbalanced")
      s.staging.unbalanced = atof(v.c_str());
    else if (k == "step")
      s.staging.step = atof(v.c_str());
    else if (k == "effects") {
      std::stringstream ss(v);
      std::string w;
      while (std::getline(ss, w, ',')) s.model.effects.push_back(w);
    } else if (k == "porosity")
      s.consolidation.porosity = atof(v.c_str());
    else
      s.model.parameters[k] = atof(v.c_str());
  }
  int step = 0;
  if (!path.empty()) {
    std::ifstream p(path);
    double x;
    while (p >> x) s.path.push_back({x, step++});
  } else
    for (double x = 0; x < to + by / 2; x += by) s.path.push_back({x, step++});
  auto t0 = std::chrono::steady_clock::now();
  printf("load_step");
  for (auto& o : FindTest(s.test)->observables) printf(",%s", o.c_str());
  puts("");
  auto r = Simulate(s,
                    [](const State& st) {
                      printf("%d", st.load_step);
                      for (double v : st.values) printf(",%.9g", v);
                      puts("");
                    },
                    {});
  double w = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
  if (!r.ok()) {
    std::cerr << r.status() << "\n";
    return 1;
  }
  fprintf(stderr,
          "outcome %d %s steps %ld updates %.3g M wall %.2f s %.2f M updates/s dt %.4g rate %.3g\n",
          (int)r->outcome, r->reason.c_str(), (long)r->steps, r->contact_updates / 1e6, w,
          r->contact_updates / 1e6 / w, r->time_step, *r->staging.rate);
}

"""tools/check_sources must accept a good tree and name each kind of offence in a bad one."""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

CHECK = Path(__file__).resolve().parents[2] / "tools" / "check_sources"
HEADER = "#pragma once\n"


def check(files):
    """Exit code and output of the check on a tree of {name: text}."""
    with tempfile.TemporaryDirectory() as root:
        for name, text in files.items():
            path = Path(root) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        done = subprocess.run([sys.executable, CHECK, root], capture_output=True, text=True)
        return done.returncode, done.stdout


class CheckSources(unittest.TestCase):
    good = {"sim/a.h": HEADER, "adjoint/b.h": HEADER + '#include "sim/a.h"\n',
            "fitting/c.cpp": '#include <ceres/ceres.h>\n#include "adjoint/b.h"\n',
            "tests/t.cpp": '#include "adjoint/b.h"\n#include "support.h"\n', "tests/support.h": HEADER,
            "sim/README.md": "`a.h`, `sim/a.h`, `*.h` and `../fitting/c.cpp`, but not what is not quoted: gone.h\n"}

    def test_good_tree(self):
        self.assertEqual(check(self.good)[0], 0)

    def test_empty_tree_is_not_good(self):
        self.assertNotEqual(check({})[0], 0)

    def test_offences(self):
        offences = {
            "against the order": {"sim/x.cpp": '#include "adjoint/b.h"\n'},
            "belong to fitting": {"adjoint/x.cpp": "#include <opencv2/core.hpp>\n"},
            "only tests include": {"sim/x.cpp": '#include "tests/t.cpp"\n'},
            "not a file of the tree": {"sim/x.cpp": '#include "a.h"\n'},
            "no #pragma once": {"sim/x.h": "\n"},
            "at most 500": {"sim/x.cpp": "// line\n" * 501},
            "command line belongs": {"fitting/x.cpp": "#include <CLI/CLI.hpp>\n"},
            "names gone.h, which": {"sim/README.md": "\n| `a.h` | `gone.h` |\n"},
            "names ../sim/b.h, which": {"fitting/README.md": "`../sim/b.h`\n"},
        }
        for message, files in offences.items():
            with self.subTest(message):
                code, output = check({**self.good, **files})
                self.assertEqual(code, 1)
                self.assertIn(message, output)
                self.assertIn("1 complaints", output)


if __name__ == "__main__":
    unittest.main()

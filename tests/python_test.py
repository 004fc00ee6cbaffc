"""The Python package against closed forms, NumPy, and the command line."""

import ast
import inspect
import json
import math
import os
import pathlib
import signal
import subprocess
import tempfile
import threading
import unittest

import numpy as np

import lobefit
from lobefit import _lobefit

PROGRAM = os.environ["LOBEFIT_PROGRAM"]


def command(*arguments):
    """What the command line prints."""
    return subprocess.run([PROGRAM, *arguments], check=True, capture_output=True, text=True).stdout


def command_json(*arguments):
    return json.loads(command(*arguments, "--json"))


def random_directions(count, seed):
    random = np.random.default_rng(seed)
    return lobefit.directions(np.degrees(np.arccos(random.random(count))), 360 * random.random(count))


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def assert_error(self, code, text, work):
        with self.assertRaisesRegex(lobefit.Error, text) as caught:
            work()
        self.assertEqual(caught.exception.code, code)


class Package(unittest.TestCase):
    def test_stub_names_what_the_module_has(self):
        stub = ast.parse((pathlib.Path(lobefit.__file__).parent / "_lobefit.pyi").read_text())

        def names(body):
            found = set()
            for node in body:
                if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                    found.add(node.name)
                elif isinstance(node, ast.AnnAssign):
                    found.add(node.target.id)
            return {name for name in found if not name.startswith("_")}

        def public(thing):
            return {name for name in vars(thing) if not name.startswith("_")}

        self.assertEqual(names(stub.body), public(_lobefit))
        (file,) = [node for node in stub.body if isinstance(node, ast.ClassDef) and node.name == "File"]
        self.assertEqual(names(file.body), public(_lobefit.File))

    def test_parameters_never_hide_behind_other_arguments(self):
        functions = {
            lobefit.Model.evaluate: lobefit.models(),
            lobefit.Model.albedo: lobefit.models(),
            lobefit.Reference.evaluate: lobefit.references(),
            lobefit.render: lobefit.models() + lobefit.references(),
            lobefit.Table.compare: lobefit.models(),
            lobefit.shader: lobefit.models(),
        }
        for function, names in functions.items():
            taken = set(inspect.signature(function).parameters) - {"parameters"}
            for name in names:
                described = lobefit.reference(name) if name in lobefit.references() else lobefit.model(name)
                self.assertFalse(taken & {p.name for p in described.parameters}, (function, name))

    def test_everything_public_is_documented_and_typed(self):
        for name in lobefit.__all__:
            thing = getattr(lobefit, name)
            self.assertTrue(thing.__doc__, name)
            if inspect.isfunction(thing):
                self.assertNotIn(inspect.Signature.empty, [inspect.signature(thing).return_annotation])
        self.assertTrue((pathlib.Path(lobefit.__file__).parent / "py.typed").exists())

    def test_version_is_the_programs(self):
        self.assertIn(lobefit.__version__, command("--version"))


class Models(Folder):
    def test_lambert_is_its_closed_form(self):
        wi, wo = random_directions(10000, 1), random_directions(10000, 2)
        f = lobefit.model("lambert").evaluate(wi, wo, albedo=(0.8, 0.5, 0.2))
        self.assertEqual(f.shape, (10000, 3))
        np.testing.assert_allclose(f, np.broadcast_to(np.array([0.8, 0.5, 0.2]) / math.pi, f.shape), rtol=1e-15)
        albedo, error = lobefit.model("lambert").albedo([0, 45, 85], albedo=(0.8, 0.5, 0.2))
        np.testing.assert_allclose(albedo, np.broadcast_to([0.8, 0.5, 0.2], (3, 3)), rtol=1e-6)
        self.assertLess(np.max(error), 1e-6)

    def test_below_the_horizon_nothing_is_reflected(self):
        below = lobefit.model("lambert").evaluate(lobefit.directions(100), lobefit.directions(20))
        self.assertEqual(below.tolist(), [0.0, 0.0, 0.0])

    def test_directions_are_those_of_the_angles(self):
        theta, phi = np.array([[0.0], [30.0], [60.0]]), np.array([0.0, 90.0])
        expected = np.stack(
            np.broadcast_arrays(
                np.sin(np.radians(theta)) * np.cos(np.radians(phi)),
                np.sin(np.radians(theta)) * np.sin(np.radians(phi)),
                np.cos(np.radians(theta)),
            ),
            axis=-1,
        )
        np.testing.assert_allclose(lobefit.directions(theta, phi), expected, atol=1e-15)

    def test_values_are_those_of_the_command_line_to_the_last_bit(self):
        cases = {
            "proxima": {"alpha": 0.5, "albedo": (0.8, 0.5, 0.2)},
            "callisto": {"alpha": 0.2, "diffuse_fresnel": 2.0, "f0": (0.04, 0.05, 0.06)},
            "eon": {"roughness": 0.7},
            "specular_karis": {"distribution": "beckmann", "alpha": 0.4},
            "g_smith_ggx": {"alpha": 0.3},
            "unreal_default_lit": {"metallic": 0.5, "roughness": 0.3},
        }
        angles = [((60, 0), (30, 180)), ((10, 33.3), (80, 200)), ((89.5, 0), (89, 180)), ((45, 45), (45, 45))]
        for name, parameters in cases.items():
            arguments = ["eval", name]
            for key, value in parameters.items():
                arguments += ["--set", f"{key}={','.join(map(str, value)) if isinstance(value, tuple) else value}"]
            for wi, wo in angles:
                arguments += ["--wi", f"{wi[0]},{wi[1]}", "--wo", f"{wo[0]},{wo[1]}"]
            told = [v["f"] for v in command_json(*arguments)["values"]]
            wi, wo = (lobefit.directions(*np.array([pair[k] for pair in angles]).T) for k in (0, 1))
            self.assertEqual(lobefit.model(name).evaluate(wi, wo, **parameters).tolist(), told, name)

    def test_every_model_in_single_stays_close_to_double(self):
        wi, wo = random_directions(500, 3), random_directions(500, 4)
        wi, wo = wi.astype(np.float32), wo.astype(np.float32)
        keep = (wi[:, 2] > 0.2) & (wo[:, 2] > 0.2)
        for name in lobefit.models():
            model = lobefit.model(name)
            single = model.evaluate(wi[keep], wo[keep], precision="single")
            self.assertEqual(single.dtype, np.float32)
            # The bound of `lobefit check`, with room for the handful of pairs that it judges by their conditioning.
            double = model.evaluate(wi[keep], wo[keep])
            np.testing.assert_allclose(single, double, rtol=1e-4, atol=1e-5, err_msg=name)

    def test_many_pairs_are_each_what_they_are_alone(self):
        model = lobefit.model("callisto")
        wi, wo = random_directions(100001, 5), random_directions(100001, 6)
        for precision in ("double", "single"):
            all_pairs = model.evaluate(wi, wo, alpha=0.3, precision=precision)
            for i in (0, 511, 512, 70000, 100000):
                alone = model.evaluate(wi[i], wo[i], alpha=0.3, precision=precision)
                self.assertEqual(all_pairs[i].tolist(), alone.tolist())
            halves = model.evaluate(wi[::2], wo[::2], alpha=0.3, precision=precision)
            self.assertTrue(np.array_equal(halves, all_pairs[::2]))

    def test_directions_and_parameters_broadcast(self):
        model = lobefit.model("proxima")
        wi, wo = lobefit.directions([0, 20, 40, 60])[:, np.newaxis], lobefit.directions([10, 50, 70], 180)
        alpha = np.array([0.2, 0.5, 1.0])
        albedo = np.random.default_rng(7).random((4, 1, 3))
        grey = np.array([[0.1], [0.2], [0.3]])
        for precision in ("double", "single"):
            f = model.evaluate(wi, wo, precision=precision, alpha=alpha, albedo=albedo)
            g = model.evaluate(wi, wo, precision=precision, albedo=grey)
            self.assertEqual(f.shape, (4, 3, 3))
            for i in range(4):
                for j in range(3):
                    one = model.evaluate(wi[i, 0], wo[j], precision=precision, alpha=alpha[j], albedo=albedo[i, 0])
                    self.assertEqual(f[i, j].tolist(), one.tolist())
                    one = model.evaluate(wi[i, 0], wo[j], precision=precision, albedo=grey[j, 0])
                    self.assertEqual(g[i, j].tolist(), one.tolist())
        self.assertEqual(model.evaluate(wi[:0, 0], wo[0]).shape, (0, 3))

    def test_mistakes_are_told(self):
        model, up = lobefit.model("proxima"), lobefit.directions(0)
        self.assert_error(2, "did you mean 'proxima'", lambda: lobefit.model("proxma"))
        self.assert_error(2, "did you mean 'alpha'", lambda: model.evaluate(up, up, alfa=0.5))
        self.assert_error(2, "did you mean 'alpha'", lambda: model.evaluate(up, up, alfa=[0.5, 0.6]))
        self.assert_error(2, "from 0 to 1", lambda: model.evaluate(up, up, alpha=1.5))
        self.assert_error(2, "from 0 to 1", lambda: model.evaluate(up, up, alpha=[0.5, math.nan]))
        self.assert_error(2, "finite", lambda: model.evaluate(up, up, alpha=math.nan))
        self.assert_error(2, "unit vector", lambda: model.evaluate(2 * up, up))
        self.assert_error(2, "unit vector", lambda: model.evaluate(up, [math.nan, 0, 1], precision="single"))
        many = np.broadcast_to(up, (70000, 3)).copy()
        many[65000, 0] = 0.5
        self.assert_error(2, "direction 65000", lambda: model.evaluate(many, up))
        self.assert_error(2, "direction 65000", lambda: model.evaluate(many.astype("f"), up, precision="single"))
        self.assert_error(2, r"shape \(2,\)", lambda: model.evaluate([0, 1], up))
        self.assert_error(2, "do not go together", lambda: model.evaluate(np.tile(up, (3, 1)), np.tile(up, (2, 1))))
        self.assert_error(2, "colour", lambda: model.evaluate(up, up, albedo=[0.5, 0.6]))
        self.assert_error(2, "not real numbers", lambda: model.evaluate(up + 0j, up))
        self.assert_error(2, "precision", lambda: model.evaluate(up, up, precision="half"))
        self.assert_error(2, "180", lambda: lobefit.directions(181))
        self.assert_error(2, "below 90", lambda: model.albedo(90))
        karis = lobefit.model("specular_karis")
        self.assert_error(2, "ggx", lambda: karis.evaluate(up, up, distribution="gggx"))
        self.assert_error(2, "same for all pairs", lambda: karis.evaluate(up, up, distribution=[0, 1]))

    def test_descriptions_are_those_of_the_command_line(self):
        told = {m["name"]: m for m in command_json("models")["models"]}
        self.assertEqual(lobefit.models(), list(told))
        for name, expected in told.items():
            model = lobefit.model(name)
            self.assertEqual(model.kind, expected["kind"])
            self.assertEqual(model.operations, expected["operations"])
            self.assertEqual([p.name for p in model.parameters], [p["name"] for p in expected["params"]])
            for parameter, p in zip(model.parameters, expected["params"]):
                self.assertEqual(parameter.initial, p["default"])
                self.assertEqual(list(parameter.choices), p.get("choices", []))

    def test_shader_is_the_exported_one(self):
        told = command("export", "eon", "--lang", "glsl", "--set", "roughness=0.3")
        own = lobefit.shader("eon", "glsl", roughness=0.3)
        without_origin = [[line for line in text.splitlines() if "Written by" not in line] for text in (told, own)]
        self.assertEqual(*without_origin)
        self.assert_error(2, "hlsl", lambda: lobefit.shader("eon", "cobol"))

    def test_threads_may_call_at_once(self):
        model, wi, wo = lobefit.model("callisto"), random_directions(200000, 8), random_directions(200000, 9)
        expected, found = model.evaluate(wi, wo), [None] * 4

        def work(k):
            found[k] = model.evaluate(wi, wo)

        threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertTrue(all(np.array_equal(values, expected) for values in found))


class References(Folder):
    def test_quadrature_is_the_command_lines(self):
        told = command_json(
            "reference", "microfacet_diffuse", "--set", "alpha=0.5", "--wi", "60,0", "--wo", "50,180", "--exact"
        )
        found = lobefit.reference("microfacet_diffuse").evaluate(
            lobefit.directions(60, 0), lobefit.directions(50, 180), alpha=0.5
        )
        self.assertEqual(found[:1].tolist(), told["f"])

    def test_furnace(self):
        # Facets that absorb nothing, all bounces: what comes in goes out.
        albedo, _ = lobefit.reference("microfacet_diffuse").albedo(30, alpha=0.5, bounces="all")
        np.testing.assert_allclose(albedo, 1.0, atol=1e-5)


class Tables(Folder):
    def test_a_models_table_has_its_values(self):
        table = lobefit.render("burley", grid="small", axes={"roughness": [0.2, 0.7]}, albedo=(0.8, 0.5, 0.2))
        self.assertEqual([a.name for a in table.axes], ["roughness", "theta_o", "theta_i", "phi"])
        self.assertEqual(table.values.shape, (2, 9, 9, 10, 3))
        self.assertEqual(table.values.shape[:-1], tuple(len(a.values) for a in table.axes))
        self.assertEqual(table.axis("phi").unit, "degree")
        wi, wo = table.directions()
        # The light at its angles, the view in the plane of azimuth 0.
        np.testing.assert_allclose(wi[0, 3, 4, 5], lobefit.directions(40, 100), atol=1e-15)
        np.testing.assert_allclose(wo[0, 3, 4, 5], lobefit.directions(30, 0), atol=1e-15)
        roughness = table.axis("roughness").values[:, np.newaxis, np.newaxis, np.newaxis]
        f = lobefit.model("burley").evaluate(wi, wo, roughness=roughness, albedo=(0.8, 0.5, 0.2))
        self.assertTrue(np.array_equal(table.values, f.astype(np.float32)))
        self.assertTrue(table.valid.all())
        at_point = table.evaluate(wi[1, 3, 4, 5], wo[1, 3, 4, 5], roughness=0.7)
        np.testing.assert_allclose(at_point, table.values[1, 3, 4, 5], rtol=1e-6)
        self.assertTrue(np.array_equal(table.row(roughness=0.7).values, table.values[1]))
        outside = table.evaluate(lobefit.directions(85), lobefit.directions(0), roughness=0.7)
        self.assertTrue(np.isnan(outside).all())
        self.assert_error(2, "which roughness", lambda: table.row())
        self.assert_error(2, "no row", lambda: table.row(roughness=0.3))

    def test_arrays_are_views_that_outlive_their_table(self):
        table = lobefit.render("eon", grid="small")
        values, valid = table.values, table.valid
        self.assertTrue(np.shares_memory(values, table.values))
        with self.assertRaises(ValueError):
            values[0, 0, 0, 0] = 1.0
        with self.assertRaises(ValueError):
            valid[0, 0, 0] = False
        copy = values.copy()
        del table
        self.assertTrue(np.array_equal(values, copy))
        self.assertEqual(valid.dtype, np.bool_)

    def test_written_files_are_the_command_lines(self):
        path = self.folder / "truth.exr"
        command(
            "render", "microfacet_diffuse", "--grid", "small", "--axis", "alpha=0.1,1", "--samples", "256",
            "--set", "masking=area_mean", "--seed", "5", "-o", str(path),
        )  # fmt: skip
        told, own = lobefit.table(path), lobefit.render(
            "microfacet_diffuse", grid="small", axes={"alpha": [0.1, 1]}, samples=256, masking="area_mean", seed=5
        )
        self.assertTrue(np.array_equal(told.values, own.values))
        self.assertTrue(np.array_equal(told.stderr, own.stderr))
        self.assertGreater(own.stderr.max(), 0.0)
        self.assertEqual(told.describe(), command_json("table", "info", str(path)))
        copy = self.folder / "own.exr"
        own.write(copy)
        again = command_json("table", "info", str(copy))
        self.assertEqual(again, own.describe())
        self.assertEqual(
            again["provenance"]["command"],
            "lobefit.render('microfacet_diffuse', grid='small', axes={'alpha': [0.1, 1.0]}, samples=256, seed=5, "
            "masking='area_mean')",
        )
        self.assert_error(2, "exists", lambda: own.write(copy))
        own.write(copy, force=True)
        self.assert_error(3, "no such file", lambda: lobefit.table(self.folder / "nothing.exr"))
        (self.folder / "bad.exr").write_bytes(b"\x76\x2f\x31\x01 no picture")
        self.assert_error(3, "bad.exr", lambda: lobefit.table(self.folder / "bad.exr"))

    def test_own_numbers_on_a_grid(self):
        theta, phi = [0.0, 30.0, 60.0], [0.0, 90.0, 180.0]
        values = np.random.default_rng(1).random((3, 3, 3, 3)).astype(np.float32)
        values[0, 1, 2, 0] = np.nan
        mask = np.ones((3, 3, 3), dtype=bool)
        mask[2, 2, 2] = False
        table = lobefit.Table.of_grid(theta, theta, phi, values, stderr=0.01 * np.ones_like(values), valid=mask)
        self.assertEqual(table.valid.sum(), 25)
        self.assertTrue(np.array_equal(table.values[table.valid], values[table.valid]))
        path = self.folder / "own.exr"
        table.write(path)
        back = lobefit.table(path)
        self.assertTrue(np.array_equal(back.values[back.valid], values[table.valid]))
        self.assertTrue(np.array_equal(back.valid, table.valid))
        self.assert_error(2, "shape", lambda: lobefit.Table.of_grid(theta, theta, [0.0], values))
        self.assert_error(3, "increase", lambda: lobefit.Table.of_grid(theta[::-1], theta, phi, values))

    def test_own_numbers_at_any_directions(self):
        wi, wo = random_directions(400, 1), random_directions(400, 2)
        values = 0.3 / math.pi + 0.1 * wi[:, 2] * wo[:, 2]
        table = lobefit.Table.of_directions(wi, wo, values, isotropic=True)
        self.assertEqual(table.coordinates, "list")
        np.testing.assert_allclose(table.values[0, 0, :, 0], values, rtol=1e-6)
        np.testing.assert_allclose(table.directions()[0][0, 0], wi, atol=1e-6)
        path = self.folder / "own.exr"
        table.write(path)
        self.assertTrue(np.array_equal(lobefit.table(path).values, table.values))

    def test_comparison_is_the_command_lines(self):
        path = self.folder / "truth.exr"
        truth = lobefit.render("microfacet_diffuse", grid="small", alpha=0.5, samples=256)
        truth.write(path)
        told = command_json("table", "compare", str(path), "chan_2024", "--weights", "sin_theta_i", "--sphere", "16")
        own = truth.compare("chan_2024", weights="sin_theta_i", sphere=16)
        self.assertEqual(own["metrics"], told["metrics"])
        self.assertEqual(own["report"], told["report"])
        # Lambert at two albedos: pi f differs by their difference everywhere.
        half, quarter = (lobefit.render("lambert", grid="small", albedo=a) for a in (0.5, 0.25))
        np.testing.assert_allclose(half.compare(quarter, sphere=0)["metrics"]["brdf"], 0.25, rtol=1e-6)
        np.testing.assert_allclose(half.compare("lambert", albedo=0.25, sphere=0)["metrics"]["brdf"], 0.25, rtol=1e-6)

    def test_mistakes_are_told(self):
        self.assert_error(2, "did you mean", lambda: lobefit.render("microfacet_difuse"))
        self.assert_error(2, "grid", lambda: lobefit.render("eon", grid="tiny"))
        self.assert_error(2, "empty", lambda: lobefit.render("eon", axes={"roughness": []}))
        self.assert_error(2, "out of range", lambda: lobefit.render("eon", axes={"roughness": [2]}))
        self.assert_error(2, "samples", lambda: lobefit.render("microfacet_diffuse", samples=1))
        self.assert_error(2, "samples", lambda: lobefit.render("microfacet_diffuse", samples=-1))
        self.assert_error(2, "seed", lambda: lobefit.render("microfacet_diffuse", seed=0.5))
        self.assert_error(2, "positive", lambda: lobefit.render("microfacet_diffuse", stderr=-1))
        self.assert_error(2, "sobol or philox", lambda: lobefit.render("microfacet_diffuse", sampler="halton"))


class Fits(Folder):
    def proxima_table(self, a, b):
        """Proxima with other constants, written down in NumPy."""
        theta, phi = np.arange(0.0, 90.0, 10.0), np.arange(0.0, 181.0, 20.0)
        wi = lobefit.directions(theta[:, np.newaxis], phi)[np.newaxis]
        wo = lobefit.directions(theta)[:, np.newaxis, np.newaxis]
        retro = np.sum(wi * wo, axis=-1)
        fade = 1 - np.sqrt(np.maximum(-retro, 0.0))
        values = 0.7 / math.pi * (1 + 0.4 * (a + b / wi[..., 2]) * fade)
        return lobefit.Table.of_grid(theta, theta, phi, np.broadcast_to(values, (9, 9, 10)))

    def test_known_constants_are_found(self):
        calls = []
        found = lobefit.fit(
            "proxima",
            self.proxima_table(-0.3, 0.1),
            free={"a": -0.5, "b": None, "albedo": None},
            fix={"alpha": 0.4},
            metric="brdf",
            progress=lambda fraction, what: calls.append((fraction, what)),
        )
        self.assertTrue(found.converged and found.identifiable)
        for name, value in {"a": -0.3, "b": 0.1, "albedo": 0.7}.items():
            self.assertAlmostEqual(found.parameters[name].value, value, places=5)
            self.assertTrue(found.parameters[name].free)
        self.assertFalse(found.parameters["alpha"].free)
        self.assertEqual(found.values["alpha"], 0.4)
        self.assertEqual(
            found.document["provenance"]["command"],
            "lobefit.fit('proxima', table, free=['a=-0.5', 'b', 'albedo'], fix=['alpha=0.4'], metric='brdf')",
        )
        self.assertLess(found.metrics["brdf"], 1e-6)
        self.assertEqual(found.correlation.shape, (3, 3))
        np.testing.assert_allclose(np.diag(found.correlation), 1.0)
        self.assertEqual(calls[-1], (1.0, "fit proxima"))
        wi, wo = lobefit.directions(40, 120), lobefit.directions(60)
        cosine = float(np.dot(wi, wo))
        expected = 0.7 / math.pi * (1 + 0.4 * (-0.3 + 0.1 / wi[2]) * (1 - math.sqrt(max(-cosine, 0))))
        np.testing.assert_allclose(found.evaluate(wi, wo), expected, rtol=1e-5)
        self.assertIn("converged", str(found))

    def test_the_command_line_finds_the_same_bits(self):
        table, path = self.folder / "truth.exr", self.folder / "fit.json"
        lobefit.render("microfacet_diffuse", grid="small", axes={"alpha": [0.3, 0.8]}, samples=512).write(table)
        options = ["--free", "a,b", "--metric", "cosine", "--holdout", "0.2"]
        command("fit", "proxima", str(table), *options, "-o", str(path))
        own, told = lobefit.fit("proxima", table, free=["a", "b"], metric="cosine", holdout=0.2), lobefit.read_fit(path)
        self.assertEqual(own.parameters, told.parameters)
        self.assertGreater(own.parameters["a"].stderr, 0.0)
        self.assertEqual(own.metrics, told.metrics)
        self.assertEqual(own.holdout, told.holdout)
        self.assertEqual(own.document["provenance"]["table_sha256"], told.document["provenance"]["table_sha256"])
        copy = self.folder / "own.json"
        own.write(copy)
        self.assertEqual(lobefit.read_fit(copy).parameters, own.parameters)
        self.assert_error(2, "exists", lambda: own.write(copy))
        exported = command("export", str(copy), "--lang", "hlsl").splitlines()
        lines = own.shader("hlsl").splitlines()
        without_origin = [
            [x for x in text if "Written by" not in x and "Fitted constants from" not in x] for text in (lines, exported)
        ]
        self.assertEqual(*without_origin)
        self.assertTrue(any("95 % interval" in line for line in lines))
        of_table = lobefit.table(table).compare(own, sphere=0)["metrics"]
        self.assertEqual(of_table, command_json("table", "compare", str(table), str(copy))["metrics"])

    def test_colours_come_back(self):
        truth = lobefit.render("lambert", grid="small", albedo=(0.8, 0.5, 0.2))
        found = lobefit.fit("lambert", truth, free=["albedo"])
        np.testing.assert_allclose(found.values["albedo"], (0.8, 0.5, 0.2), rtol=1e-6)
        self.assertEqual(set(found.parameters), {"albedo.r", "albedo.g", "albedo.b"})

    def test_mistakes_are_told(self):
        table = self.proxima_table(-0.3, 0.1)
        self.assert_error(2, "did you mean", lambda: lobefit.fit("proxima", table, free=["c"]))
        self.assert_error(2, "list of names", lambda: lobefit.fit("proxima", table, free="a"))
        self.assert_error(2, "metric|quantity|cosine", lambda: lobefit.fit("proxima", table, metric="l2"))
        self.assert_error(2, "tier", lambda: lobefit.fit("proxima", table, tier="basic"))
        self.assert_error(2, "starts", lambda: lobefit.fit("proxima", table, starts=0))
        self.assert_error(2, "holdout", lambda: lobefit.fit("proxima", table, holdout=1.5))
        self.assert_error(2, "starts.*wrong type|wrong type.*starts", lambda: lobefit.fit("proxima", table, starts="x"))
        self.assert_error(2, "seed", lambda: lobefit.fit("proxima", table, seed=-1))
        self.assert_error(2, "intervals", lambda: lobefit.fit("proxima", table, intervals="dat"))
        self.assert_error(2, "bounds", lambda: lobefit.fit("proxima", table, bounds={"alpha": (0.5, 3)}))
        path = self.folder / "fit.json"
        path.write_text('{"model": "proxima"}')
        self.assert_error(3, "params", lambda: lobefit.read_fit(path))


class LongWork(Folder):
    """Renders that would take minutes, stopped."""

    @staticmethod
    def render(progress=None):
        return lobefit.render("microfacet_diffuse", samples=1 << 26, progress=progress)

    def test_progress_rises_to_the_end(self):
        calls = []
        lobefit.render(
            "microfacet_diffuse", samples=1 << 16, progress=lambda fraction, what: calls.append((fraction, what))
        )
        fractions = [fraction for fraction, _ in calls]
        self.assertEqual(fractions, sorted(fractions))
        self.assertEqual(calls[-1], (1.0, "render microfacet_diffuse"))
        self.assertGreaterEqual(fractions[0], 0.0)

    def test_false_stops(self):
        calls = []

        def progress(fraction, what):
            calls.append(fraction)
            return len(calls) < 2

        with self.assertRaises(lobefit.Interrupted) as caught:
            self.render(progress)
        self.assertEqual(caught.exception.code, 130)
        self.assertEqual(len(calls), 2)

    def test_what_progress_raises_is_raised(self):
        def progress(fraction, what):
            raise KeyError("enough")

        with self.assertRaisesRegex(KeyError, "enough"):
            self.render(progress)

    def test_control_c_stops(self):
        timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        self.addCleanup(timer.cancel)
        with self.assertRaises(KeyboardInterrupt):
            self.render()

    def test_other_threads_go_on(self):
        # The lock is free meanwhile: another thread runs, and stops the work.
        ran = threading.Event()
        thread = threading.Thread(target=ran.set)

        def progress(fraction, what):
            if not thread.is_alive() and not ran.is_set():
                thread.start()
            return not ran.wait(0.01)

        with self.assertRaises(lobefit.Interrupted):
            self.render(progress)
        thread.join()


if __name__ == "__main__":
    unittest.main()

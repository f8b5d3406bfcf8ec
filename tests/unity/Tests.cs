// The client against a real server with the simulated hand, and the components as Unity would run them.
//   Tests.exe HOST:PORT
using System;
using System.Collections.Generic;
using System.Net.Sockets;
using System.Text;
using System.Threading;
using Hapticd;
using UnityEngine;

static class Tests
{
    static string address;
    static int failed;

    static int Main(string[] arguments)
    {
        address = arguments[0];
        Run("the wire: what is written", Writes);
        Run("the wire: what is read, cut anywhere", Reads);
        Run("the wire: what is refused", Refuses);
        Run("a sphere is felt, moves away and comes back", FeelsASphere);
        Run("stop, marker, texts", ControlsAndHears);
        Run("a batch that throws sends nothing", DropsABatch);
        Run("wrong input is refused by name", NamesWhatIsWrong);
        Run("components: where things are", PlacesThings);
        Run("components: they connect again", ConnectsAgain);
        Run("what was commanded arrives before the end", SendsBeforeTheEnd);  // the forces stay stopped
        Console.WriteLine(failed + " failed");
        return failed == 0 ? 0 : 1;
    }

    static void Run(string name, Action test)
    {
        try
        {
            test();
            Console.WriteLine("passed: " + name);
        }
        catch (Exception error)
        {
            ++failed;
            Console.WriteLine("FAILED: " + name + ": " + error);
        }
    }

    static void Check(bool holds, string what)
    {
        if (!holds) throw new Exception(what);
    }

    static void Near(double value, double expected, double tolerance, string what)
    {
        Check(Math.Abs(value - expected) <= tolerance, what + " is " + value + ", expected " + expected);
    }

    static void Until(Func<bool> holds, string what)
    {
        for (int i = 0; i < 3000; ++i)
        {
            if (holds()) return;
            Thread.Sleep(10);
        }
        throw new Exception("not in 30 s: " + what);
    }

    static string Refusal<E>(Action action) where E : Exception
    {
        try
        {
            action();
        }
        catch (E error)
        {
            return error.Message;
        }
        throw new Exception("not refused");
    }

    static HapticClient Client()
    {
        HapticClient client = new HapticClient("Phantom@tcp://" + address, 10000, 1000);
        client.TextReceived += (severity, text) => Console.WriteLine("  " + severity + ": " + text);
        return client;
    }

    static TickReport Newest(HapticClient client)
    {
        client.Poll();
        TickReport tick;
        client.TryGetTick(out tick);
        return tick;
    }

    // --- the wire

    static string Hex(byte[] bytes, int begin, int size) { return BitConverter.ToString(bytes, begin, size).Replace("-", ""); }

    static void Writes()
    {
        Peer peer = new Peer("Phantom", new[] { "vrpn_Base ping_message", "hapticd Subscribe" }, (type, payload) => {});
        byte[] opening = peer.Opening();
        Check(Hex(opening, 0, 24) == "7672706E3A207665722E2030372E3338202030" + "0000000000", "the cookie");
        Check(Hex(opening, 24, 4) == "00000024", "the length is without padding");
        Check(Hex(opening, 36, 24) == "00000000FFFFFFFF00000000" + "000000085068616E746F6D00", "the device is sender 0");
        Check(opening.Length == 24 + 40 + 56 + 48, "all names, padded to 8 bytes");
        byte[] frame = peer.Message("hapticd Subscribe", new Payload().U32(16).F64(100).ToArray());
        Check(Hex(frame, 12, 28) == "0000000000000001000000000000001040590000000000" + "0000000000", "the message");
    }

    static byte[] FromServer()
    {
        List<byte> bytes = new List<byte>();
        bytes.AddRange(Encoding.ASCII.GetBytes("vrpn: ver. 07.35  0\0\0\0\0\0"));
        bytes.AddRange(Frame(-1, 5, new Payload().I32(8).Text("Phantom", 8, true, "").ToArray()));
        bytes.AddRange(Frame(-1, 6, new Payload().I32(6).Text("Other", 6, true, "").ToArray()));
        bytes.AddRange(Frame(-2, 3, new Payload().I32(6).Text("a b c", 6, true, "").ToArray()));
        bytes.AddRange(Frame(3, 6, new Payload().I32(1).ToArray()));
        bytes.AddRange(Frame(4, 5, new Payload().I32(2).ToArray()));
        bytes.AddRange(Frame(-3, 5, new byte[3]));
        bytes.AddRange(Frame(3, 5, new Payload().I32(-7).F64(0.1).Text("öl", 6, true, "").ToArray()));
        return bytes.ToArray();
    }

    static byte[] Frame(int type, int sender, byte[] payload)
    {
        Payload frame = new Payload().I32(24 + payload.Length).U32(1).U32(2).I32(sender).I32(type).U32(0);
        List<byte> bytes = new List<byte>(frame.ToArray());
        bytes.AddRange(payload);
        while (bytes.Count % 8 != 0) bytes.Add(0xEE);
        return bytes.ToArray();
    }

    static void Reads()
    {
        byte[] bytes = FromServer();
        for (int cut = 0; cut <= bytes.Length; ++cut)
        {
            string read = "";
            Peer peer = new Peer("Phantom", new string[0], (type, payload) =>
                read += type + "|" + payload.I32() + "|" + (payload.F64() == 0.1) + "|" + payload.Text(6));
            byte[] rest = new byte[bytes.Length - cut];
            Array.Copy(bytes, cut, rest, 0, rest.Length);
            peer.Feed(bytes, cut);
            peer.Feed(rest, rest.Length);
            Check(read == "a b c|-7|True|öl", "cut at " + cut + ": " + read);
        }
    }

    static void Refuses()
    {
        Func<byte[], string> refusal = bytes =>
            Refusal<ProtocolException>(() => new Peer("P", new string[0], (t, p) => p.I64()).Feed(bytes, bytes.Length));
        byte[] http = Encoding.ASCII.GetBytes("HTTP/1.1 400 Bad Request");
        Check(refusal(http).Contains("HTTP/1.1"), "another protocol");
        List<byte> cookie = new List<byte>(Encoding.ASCII.GetBytes("vrpn: ver. 07.35  0\0\0\0\0\0"));
        Func<byte[], string> after = frame =>
        {
            List<byte> all = new List<byte>(cookie);
            all.AddRange(frame);
            return refusal(all.ToArray());
        };
        byte[] huge = Frame(1, 1, new byte[8]);
        huge[0] = 0xFF;
        Check(after(huge).Contains("bytes, expected 24 to"), "a length");
        Check(after(Frame(-1, 2000, new byte[8])).Contains("number 2000"), "a number");
        Check(after(Frame(-2, 1, new Payload().I32(0).ToArray())).Contains("of 0 bytes"), "a name");
        Check(after(Frame(-1, 1, new Payload().I32(9).ToArray())).Contains("too short"), "a name behind the end");
        Check(after(Frame(-2000, 0, new byte[0])).Contains("-2000"), "a system message");
    }

    // --- the client

    // An octahedron that was subdivided: vertices on the sphere, counter-clockwise from outside.
    static void Sphere(double radius_mm, int times, out float[] vertices, out int[] triangles)
    {
        List<double[]> corners = new List<double[]>();
        for (int axis = 0; axis < 3; ++axis)
            foreach (int sign in new[] { 1, -1 })
            {
                double[] corner = new double[3];
                corner[axis] = sign;
                corners.Add(corner);
            }
        List<double[]> faces = new List<double[]>();  // nine numbers each
        foreach (int i in new[] { 0, 1 })
            foreach (int j in new[] { 2, 3 })
                foreach (int k in new[] { 4, 5 })
                {
                    bool turn = (i + j + k) % 2 != 0;
                    faces.Add(Nine(corners[i], corners[turn ? k : j], corners[turn ? j : k]));
                }
        for (int n = 0; n < times; ++n)
        {
            List<double[]> finer = new List<double[]>();
            foreach (double[] f in faces)
            {
                double[] a = Part(f, 0), b = Part(f, 3), c = Part(f, 6);
                double[] ab = Middle(a, b), bc = Middle(b, c), ca = Middle(c, a);
                finer.AddRange(new[] { Nine(a, ab, ca), Nine(ab, b, bc), Nine(ca, bc, c), Nine(ab, bc, ca) });
            }
            faces = finer;
        }
        vertices = new float[9 * faces.Count];
        triangles = new int[3 * faces.Count];
        for (int i = 0; i < faces.Count; ++i)
            for (int k = 0; k < 9; ++k) vertices[9 * i + k] = (float)(radius_mm * faces[i][k]);
        for (int i = 0; i < triangles.Length; ++i) triangles[i] = i;
    }
    static double[] Nine(double[] a, double[] b, double[] c)
    {
        return new[] { a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2] };
    }
    static double[] Part(double[] f, int at) { return new[] { f[at], f[at + 1], f[at + 2] }; }
    static double[] Middle(double[] a, double[] b)
    {
        double[] m = { a[0] + b[0], a[1] + b[1], a[2] + b[2] };
        double length = Math.Sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]);
        return new[] { m[0] / length, m[1] / length, m[2] / length };
    }

    static void Press(HapticClient client, double from_mm, double to_mm)
    {
        for (double y = from_mm; y >= to_mm; y -= 0.2)
        {
            client.HoldHand(new Triple(0, y, 0), Rotation.Identity);
            Thread.Sleep(5);
        }
    }

    static void FeelsASphere()
    {
        using (HapticClient client = Client())
        {
            client.ResetScene();
            client.HoldHand(new Triple(0, 30, 0), Rotation.Identity);
            Until(() => Math.Abs(Newest(client).Hand_m.Y - 0.03) < 1e-4, "the hand is above");
            float[] vertices;
            int[] triangles;
            Sphere(25, 6, out vertices, out triangles);
            client.SetObjectCount(3);
            client.SetMesh(2, vertices, triangles);
            client.SetObjectName(2, "Kugel aus C# ä");
            client.SetSurface(2, Surface.Of(0.8f));
            Press(client, 30, 23);
            Until(() => Newest(client).Object == 2, "the sphere is touched");
            TickReport tick = new TickReport();
            // The guard lets the force grow slowly after a tick that was late.
            Until(() => (tick = Newest(client)).Depth_m > 1e-4 && Math.Abs(tick.Velocity_m_per_s.Y) < 1e-4 &&
                        Math.Abs(tick.Force_N.Y / tick.Depth_m - 0.8 * 500) < 8, "it rests, at 400 N/m");
            Near(tick.Proxy_m.Y, 0.025, 1e-4, "the proxy");
            Near(tick.Proxy_m.Y - tick.Hand_m.Y, tick.Depth_m, 1e-4, "the depth");
            Check(tick.Touching && !tick.Pressed(0), "it touches, no button");

            double[] away = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -30, 0, 1 };
            client.SetTransform(2, away);
            Until(() => !Newest(client).Touching, "the sphere is away");
            client.SetTransform(2, new double[] { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1 });
            client.HoldHand(new Triple(0, 30, 0), Rotation.Identity);
            Until(() => Newest(client).Hand_m.Y > 0.0299, "the hand is above");
            client.SetMesh(2, vertices, new int[0]);
            ulong revision = Newest(client).Revision;
            Until(() => Newest(client).Revision > revision, "the mesh is empty");
            Press(client, 30, 20);
            Check(!Newest(client).Touching, "vertices without triangles are not felt");
            client.HoldHand(new Triple(0, 30, 0), Rotation.Identity, 1);
            Until(() => Newest(client).Pressed(0), "the button is down");
            TickReport[] ticks = client.TakeTicks();
            Check(ticks.Length > 10, "ticks were kept");
            for (int i = 1; i < ticks.Length; ++i) Check(ticks[i].Tick > ticks[i - 1].Tick, "in order");
            client.ReleaseHand();
        }
    }

    static void ControlsAndHears()
    {
        using (HapticClient client = Client())
        {
            string marker = "";
            List<string> texts = new List<string>();
            client.MarkerReceived += text => marker = text;
            client.TextReceived += (severity, text) => texts.Add(severity + " " + text);
            client.Mark("trial 3 begins ✓");
            Until(() => { client.Poll(); return marker == "trial 3 begins ✓"; }, "the marker");
            client.SetTransform(77, new double[16]);
            Until(() => { client.Poll(); return texts.Exists(t => t.Contains("77")); }, "a refusal");

            client.SetConstantForce(0, new Triple(1, 0, 0), 1);
            client.StartEffect(0);
            Until(() => Newest(client).Force_N.X > 0.9, "the effect");
            client.StopForces();
            Until(() => Newest(client).Force_N.X == 0, "the stop");
            Check((Newest(client).GuardActive) != 0, "the guard says so");
            client.RearmForces();
            Until(() => Newest(client).Force_N.X > 0.9, "the force is back");
            client.StopEffect(0);
            Until(() => Newest(client).Force_N.X == 0, "the effect has ended");

            // A stop overtakes a long upload.
            float[] vertices;
            int[] triangles;
            Sphere(25, 7, out vertices, out triangles);
            for (int i = 0; i < 4; ++i) client.SetMesh(0, vertices, triangles);
            client.StopForces();
            ulong begun = Newest(client).Tick;
            Until(() => Newest(client).GuardActive != 0, "the stop behind an upload");
            Check(Newest(client).Tick - begun < 20000, "it came in time");
            client.RearmForces();
            Until(() => Newest(client).GuardActive == 0, "the guard is at rest");
        }
    }

    static void DropsABatch()
    {
        using (HapticClient client = Client())
        {
            client.ResetScene();
            string why = Refusal<InvalidOperationException>(() => client.Batch(() =>
            {
                client.SetConstantForce(1, new Triple(0, 1, 0), 1);
                client.StartEffect(1);
                throw new InvalidOperationException("on purpose");
            }));
            Check(why == "on purpose", why);
            client.Batch(() =>
            {
                client.SetConstantForce(2, new Triple(1, 0, 0), 1);
                client.StartEffect(2);
            });
            Until(() => Newest(client).Force_N.X > 0.9, "the second batch");
            Check(Newest(client).Force_N.Y == 0, "nothing of the first");
        }
    }

    static void SendsBeforeTheEnd()
    {
        using (HapticClient watcher = Client())
        {
            float[] vertices;
            int[] triangles;
            Sphere(25, 6, out vertices, out triangles);
            HapticClient client = Client();
            for (int i = 0; i < 3; ++i) client.SetMesh(0, vertices, triangles);
            client.StopForces();
            client.Dispose();
            Check(!client.Connected && client.WhyEnded == "closed", client.WhyEnded);
            Until(() => Newest(watcher).GuardActive != 0, "the stop of a client that left");
        }
    }

    static void NamesWhatIsWrong()
    {
        Check(Refusal<ArgumentException>(() => new HapticClient("Phantom")).Contains("'Phantom'"), "no host");
        Check(Refusal<ArgumentException>(() => new HapticClient("P@h:x")).Contains("P@h:x"), "no port");
        string none = Refusal<ConnectException>(() => new HapticClient("Nobody@" + address, 1000));
        Check(none.Contains("no device 'Nobody'; it has Phantom"), none);
        string nowhere = Refusal<ConnectException>(() => new HapticClient("Phantom@127.0.0.1:1", 1000));
        Check(nowhere.Contains("127.0.0.1:1") && nowhere.Contains("hapticd serve"), nowhere);
        TcpListener silent = new TcpListener(System.Net.IPAddress.Loopback, 0);
        silent.Start();
        string nothing = Refusal<ConnectException>(() => new HapticClient("Phantom@" + silent.LocalEndpoint, 300));
        Check(nothing.Contains("is this a VRPN server?"), nothing);
        silent.Stop();
        using (HapticClient client = Client())
        {
            Action<string, Action> refused = (part, action) =>
            {
                string text = Refusal<ArgumentException>(action);
                Check(text.Contains(part), text);
            };
            refused("4 coordinates", () => client.SetMesh(0, new float[4], new int[0]));
            refused("5 coordinates", () => client.SetVertices(0, 0, new float[5]));
            refused("vertex 0 is not finite", () => client.SetVertices(0, 0, new[] { 0, 0, float.PositiveInfinity }));
            refused("2 vertex numbers", () => client.SetMesh(0, new float[3], new int[2]));
            refused("vertex 1", () => client.SetMesh(0, new float[3], new[] { 0, 0, 1 }));
            refused("vertex 0 is not finite", () => client.SetMesh(0, new[] { 0, float.NaN, 0 }, new int[0]));
            refused("15 numbers", () => client.SetTransform(0, new double[15]));
            refused("at most 64", () => client.SetObjectName(0, new string('x', 65)));
            refused("NUL", () => client.Mark("a\0b"));
            refused("-1 Hz", () => client.Subscribe(-1));
        }
    }

    // --- the components

    static void Frames(Func<bool> holds, GameObject[] things, string what)
    {
        Until(() =>
        {
            Time.unscaledTime += 0.02f;
            foreach (GameObject thing in things) thing.Call("Update");
            return holds();
        }, what);
    }

    // A device that is turned, moved and enlarged touches a square that is as well: the proxy is on it, the force across it.
    static void PlacesThings()
    {
        GameObject device = new GameObject("device");
        device.transform.position = new Vector3(1, 2, 3);
        device.transform.rotation = Quaternion.AngleAxis(70, new Vector3(1, 2, 3));
        HapticHand hand = device.AddComponent<HapticHand>();
        hand.server = "Phantom@" + address;
        hand.scale = 2;
        hand.watchFrames = true;
        hand.proxy = new GameObject("proxy").transform;
        hand.device = new GameObject("tip").transform;

        // The plane z = 0.02 m in front of the device, seen from the device: a square in its own x and y, turned by 30 degrees
        // about the device's z, which the plane does not feel.
        GameObject wall = new GameObject("wall");
        Quaternion turn = Quaternion.AngleAxis(30, new Vector3(0, 0, 1));
        wall.transform.rotation = device.transform.rotation * turn;
        wall.transform.position = device.transform.position + device.transform.rotation * new Vector3(0, 0, 0.04f);
        wall.transform.localScale = new Vector3(0.3f, 0.2f, 5);
        Mesh mesh = new Mesh {
            vertices = new[] { new Vector3(-1, -1, 0), new Vector3(-1, 1, 0), new Vector3(1, 1, 0), new Vector3(1, -1, 0) },
            triangles = new[] { 0, 1, 2, 0, 2, 3 },  // clockwise, seen from the device
        };
        wall.AddComponent<MeshFilter>().sharedMesh = mesh;
        HapticObject felt = wall.AddComponent<HapticObject>();
        felt.stiffness = 0.6f;
        wall.Call("OnEnable");
        Check(felt.hand == hand, "the only hand of the scene");
        GameObject[] things = { device, wall };
        Frames(() => hand.IsConnected, things, "connected");
        hand.Client.SetTouchableFaces(Faces.Front);
        hand.Client.HoldHand(new Triple(10, 5, 0), Rotation.Identity);
        Frames(() => Math.Abs(hand.Tick.Hand_m.X - 0.01) < 1e-4 && Math.Abs(hand.Tick.Hand_m.Z) < 1e-4, things, "at rest");
        for (double z = 0; z > -22; z -= 0.2)  // away from the user
        {
            hand.Client.HoldHand(new Triple(10, 5, z), Rotation.Identity);
            Thread.Sleep(5);
        }
        Frames(() => hand.Touched == felt && Math.Abs(hand.Tick.Velocity_m_per_s.Z) < 1e-4 &&
                     Math.Abs(hand.Force.magnitude / hand.Tick.Depth_m - 0.6 * 500) < 6, things, "touched from its front, at 300 N/m");
        Vector3 normal = device.transform.rotation * new Vector3(0, 0, -1);
        Func<Vector3, Vector3, float> dot = (a, b) => a.x * b.x + a.y * b.y + a.z * b.z;
        Near(dot(hand.proxy.position - wall.transform.position, normal), 0, 2e-4, "the proxy on the wall, metres");
        Near(dot(hand.device.position - wall.transform.position, normal), -2 * hand.Tick.Depth_m, 2e-4, "the tip behind it");
        Near(dot(hand.Force, normal), hand.Force.magnitude, 1e-3, "the force along the normal");
        Vector3 side = device.transform.rotation * new Vector3(1, 0, 0);
        Near(dot(hand.proxy.position - device.transform.position, side), 2 * 0.01, 4e-4, "to the right");

        // The wall comes nearer by 4 mm of the scene, 2 mm of the device.
        double before = hand.Tick.Depth_m;
        for (int i = 0; i < 40; ++i)
        {
            wall.transform.position = wall.transform.position + 0.0001f * normal;
            Frames(() => true, things, "");
            Thread.Sleep(20);
        }
        Frames(() => Math.Abs(hand.Tick.Depth_m - before) > 5e-4 && hand.Touched == felt, things, "pushed");
        Near(dot(hand.proxy.position - wall.transform.position, normal), 0, 3e-4, "the proxy on the moved wall");
        felt.stiffness = 0.3f;
        Frames(() => Math.Abs(hand.Force.magnitude / hand.Tick.Depth_m - 0.3 * 500) < 6, things, "softer");
        wall.Call("OnDisable");
        Frames(() => hand.Touched == null, things, "no longer touched");
        device.Call("OnDisable");
        Check(!hand.IsConnected && hand.Client == null, "disconnected");
    }

    static void ConnectsAgain()
    {
        GameObject device = new GameObject("again");
        HapticHand hand = device.AddComponent<HapticHand>();
        GameObject[] things = { device };
        hand.server = "Phantom@127.0.0.1:1";
        Debug.Lines.Clear();
        Frames(() => Debug.Lines.Exists(line => line.Contains("no server at 127.0.0.1:1")), things, "a warning");
        int lines = Debug.Lines.Count;
        hand.server = "Phantom@" + address;
        Frames(() => hand.IsConnected, things, "connected");
        Check(Debug.Lines.Count == lines, "the warning was not repeated");
        hand.Client.Dispose();
        Frames(() => hand.IsConnected, things, "connected again");

        hand.watchFrames = true;
        Frames(() => hand.Tick.Tick > 0, things, "a heartbeat was sent");
        HapticClient before = hand.Client;
        Thread.Sleep(1500);  // as at a breakpoint
        Until(() => !before.Connected, "the server has ended the connection");
        Frames(() => hand.IsConnected && hand.Client != before, things, "connected after the pause");
        device.Call("OnDisable");
    }
}
